"use strict";
// One cursor for the map and all time panels: a line in each panel, a ring on the path, and the values at its time.
document.addEventListener("plotted", ({ detail: plotted }) => {
  const models = [...plotted._all_models.values()];
  const panels = models.filter((model) => model.tags?.includes("time"));
  const lines = models.filter((model) => model.tags?.includes("cursor"));
  const map = models.find((model) => model.name === "map");
  const path = models.find((model) => model.name === "path")?.data_source.data;
  const ring = models.find((model) => model.name === "here")?.data_source;
  const slider = document.querySelector(".cursor input");
  const shown = document.querySelector(".cursor dl");
  // What is read at the cursor: a renderer's tag says its name, unit and decimals.
  const readings = models.filter((model) => model.data_source).flatMap((model) => model.tags
    .filter((tag) => tag instanceof Map || typeof tag === "object")
    .map((tag) => ({ ...(tag instanceof Map ? Object.fromEntries(tag) : tag), data: model.data_source.data })));

  // The last index at which times are not later; -1 before the first.
  function before(times, t) {
    let low = -1, high = times.length;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (times[middle] <= t) low = middle; else high = middle;
    }
    return low;
  }

  function clock(t) {
    const two = (part) => String(part).padStart(2, "0");
    const tenths = Math.round(t * 10), seconds = Math.floor(tenths / 10);
    return `${Math.floor(seconds / 3600)}:${two(Math.floor(seconds / 60) % 60)}:${two(seconds % 60)}.${tenths % 10}`;
  }

  function valueAt({ data, decimals, unit }, t) {
    const at = before(data.x, t), value = at < 0 ? undefined : (data.value ?? data.y)[at];
    if (typeof value === "string") return value;
    if (value === undefined || Number.isNaN(value)) return "unknown";
    const digits = value.toFixed(decimals);
    return `${Number(digits) === 0 ? digits.replace("-", "") : digits} ${unit}`.trim();
  }

  function show(t) {
    for (const line of lines) line.location = t;
    if (path) {
      const at = before(path.t, t);
      ring.data = at < 0 ? { x: [], y: [] } : { x: [path.x[at]], y: [path.y[at]] };
    }
    const rows = readings.map((reading) => [reading.name, valueAt(reading, t)]);
    shown.replaceChildren(...[["time", clock(t)], ...rows].map(([name, value]) => {
      const row = document.createElement("div");
      row.dataset.name = name;
      for (const [tag, text] of [["dt", name], ["dd", value]]) {
        row.append(Object.assign(document.createElement(tag), { textContent: text }));
      }
      return row;
    }));
    slider.value = String(t);
    slider.setAttribute("aria-valuetext", clock(t));
  }

  const range = panels[0]?.x_range;
  const end = Number(slider.max);
  const within = (t) => Math.min(Math.max(t, 0), end);
  slider.addEventListener("input", () => show(Number(slider.value)));
  for (const name of ["mousemove", "tap"]) {
    for (const panel of panels) panel.on_event(name, ({ x }) => show(within(x)));
    map?.on_event(name, ({ x, y }) => {
      let nearest = Infinity, t = null;
      for (let at = 0; at < path.t.length; at += 1) {
        const distance = (path.x[at] - x) ** 2 + (path.y[at] - y) ** 2;
        if (distance < nearest) [nearest, t] = [distance, path.t[at]];
      }
      if (t !== null) show(t);
    });
  }

  // The buttons zoom around the cursor, for fingers: [smaller than now, moved by this part of what is seen].
  const moves = { in: [0.5, 0], out: [2, 0], back: [1, -0.5], on: [1, 0.5], all: [Infinity, 0] };
  for (const button of document.querySelectorAll(".cursor button")) {
    button.addEventListener("click", () => {
      const [factor, moved] = moves[button.value], wide = range.end - range.start;
      const width = Math.min(Math.max(wide * factor, range.min_interval), end), held = Number(slider.value);
      const inside = held >= range.start && held <= range.end && factor < 1;
      const middle = (inside ? held : (range.start + range.end) / 2) + moved * wide;
      const start = Math.min(Math.max(middle - width / 2, 0), end - width);
      range.setv({ start, end: start + width });
    });
  }
  show(end);
});
