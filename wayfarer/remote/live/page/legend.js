// The legend: a small picture and a word for everything that is on the map and on the strip now.

const line = (dash) => `fill="none" stroke-width="3" ${dash ? 'stroke-dasharray="6 3"' : ""}`;
const FOREST = [
  ["trunk", "M3 6 H21", 'fill="none" stroke-width="6" stroke-linecap="round"', "fallen trunk"],
  ["tree", "M12 1 A5 5 0 1 1 11.99 1 Z", 'stroke="none" class="filled"', "standing tree"],
  ["goal-line", "M0 6 H24", line(true), "edge of the forest: it is out"],
  ["ink", "M8 2 H16 V10 H8 Z", 'fill="none" stroke-width="1.5"', "start"],
];
const MARK = ["anomaly", "M12 2 A4 4 0 1 1 11.99 2 Z", 'stroke="var(--mark-edge)" class="filled"', "something stopped it"];
const ROVER = ["ink", "M8 12 V5 L12 0 L16 5 V12 Z", 'stroke="none" class="filled"', "the rover; its tip is the front"];

function writeLegend({ track, phases: strip, forest, state }) {
  const drawn = new Set([...track.slice(1).map((point) => point[2]), ...strip.map(([, phase]) => phase)]);
  const phases = Object.keys(PHASES).filter((phase) => drawn.has(phase));
  const list = element("legend"), shown = [phases, Boolean(forest), Boolean(state.place)].join();
  if (list.dataset.shown === shown) return;
  list.dataset.shown = shown;
  const paths = phases.map((phase) => [phase, "M0 6 H24", line(false), PHASES[phase]]);
  list.replaceChildren(...[...(state.place ? [ROVER] : []), ...paths, MARK, ...(forest ? FOREST : [])].map(key));
}

function key([name, shape, style, text]) {
  const item = document.createElement("li");
  item.innerHTML = `<svg viewBox="0 0 24 12" aria-hidden="true"><path d="${shape}" ${style}/></svg>`;
  const path = item.querySelector("path");
  path.setAttribute(path.classList.contains("filled") ? "fill" : "stroke", `var(--${name})`);
  item.append(text);
  return item;
}
