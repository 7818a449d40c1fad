"use strict";
// The address says which trial the map shows: #trial-3. Without a number it is the first one.
document.addEventListener("plotted", ({ detail: plotted }) => {
  const map = plotted.get_model_by_name("trials");
  if (map === null) return;
  const filter = plotted.get_model_by_name("shown");
  const kept = plotted.get_model_by_name("kept").data_source.data;
  const texts = [...document.querySelectorAll(".trials article")];
  const links = [...document.querySelectorAll(".trials nav a")];
  const [before, after, whole, close] = document.querySelectorAll(".trials button");
  const room = [map.x_range, map.y_range].map(({ start, end }) => [start, end]);
  let shown = 0;

  const look = ([west, east], [south, north]) => {
    [map.x_range.start, map.x_range.end, map.y_range.start, map.y_range.end] = [west, east, south, north];
  };
  const show = () => {
    const asked = Number(/^#trial-(\d+)$/.exec(location.hash)?.[1] ?? 0);
    shown = asked < texts.length ? asked : 0;
    filter.group = shown;
    texts.forEach((text, number) => { text.hidden = number !== shown; });
    links.forEach((link, number) => {
      if (number === shown) link.setAttribute("aria-current", "true"); else link.removeAttribute("aria-current");
    });
    before.disabled = shown === 0;
    after.disabled = shown === texts.length - 1;
    close.disabled = !kept.number.includes(shown);
    look(...room);
  };
  const step = (by) => () => { location.hash = `#trial-${shown + by}`; };
  before.addEventListener("click", step(-1));
  after.addEventListener("click", step(1));
  whole.addEventListener("click", () => look(...room));
  close.addEventListener("click", () => {
    const at = kept.number.indexOf(shown), half = kept.size[at];
    const slope = (room[1][1] - room[1][0]) / (room[0][1] - room[0][0]); // of the frame: both axes keep one scale
    look([kept.x[at] - half, kept.x[at] + half], [kept.y[at] - half * slope, kept.y[at] + half * slope]);
  });
  addEventListener("hashchange", show);
  show();
});
