// Everything that is text: what the rover does, its numbers, its sensors, its story.

const LINES_SHOWN = 200;

function writeAbout(about) {
  const marks = [about.simulated && "simulated", about.dry_run && "dry run"].filter(Boolean);
  write("rover", about.rover || "wayfarer");
  write("about", [about.algorithm, ...marks, about.version && `wayfarer ${about.version}`].filter(Boolean).join(", "));
}

function writeState(state, mayStart) {
  const ended = state.mode === "ended"; // and nothing is measured any more
  const named = state.held && state.mode === "armed" ? "Held" : MODES[state.mode] || state.mode;
  const mode = state.being_checked ? "Being checked" : named;
  write("mode", mode);
  document.title = `${model.about.rover ?? "no run yet"}: ${mode} - wayfarer`;
  write("why-disarmed", state.mode === "disarmed" ? state.why_disarmed : "");
  const since = known(state.cause_for_s) ? ` (for ${clock(state.cause_for_s)})` : "";
  write("health", ended ? "" : `${[state.level_text, state.cause_text].filter(Boolean).join(": ")}${since}`);
  write("response", ended ? "" : state.response_text);
  element("health").className = ["hold", "fault", "degrade"].includes(state.level) ? "bad" : "";
  write("phase", ended ? "" : state.phase_text);
  write("why", ended ? "" : state.why_text);
  write("time", state.time_text);
  write("time-of", state.time_of);
  write("way", fixed(state.way_m, 1, " m"));
  write("way-of", state.way_of);
  write("heading", whole(state.heading_deg));
  write("goal", whole(state.goal_heading_deg));
  write("counter", signed(state.counter_deg));
  write("episodes", fixed(state.episodes, 0));
  write("tilt", `${signed(state.pitch_deg)}, ${signed(state.roll_deg)}`);
  write("wheels", ended ? "–" : `${state.wheels.map((duty) => (known(duty) ? Math.round(duty * 100) || 0 : "–")).join("/")} %`);
  const met = state.counts.map(([what, count]) => `${count}× ${what}`).join(", ");
  write("counts", [state.anomalies.length && `now: ${state.anomalies.join(", ")}`, met && `so far: ${met}`].filter(Boolean).join(". "));
  write("further", ended ? "" : state.further);
  const isHeld = state.held && ["arming", "armed"].includes(state.mode);
  element("resume").hidden = !isHeld || !mayStart;
  element("how-to-resume").hidden = !isHeld || mayStart;
  const battery = known(state.battery_v) ? `battery ${state.battery_v.toFixed(1)} V` : "";
  write("battery", [battery, ...state.faults].filter(Boolean).join(", "));
  element("battery").className = state.faults.length ? "bad" : "";
}

// The ages go on while nothing comes: `silentS` is for how long that has been; null after the end, when they mean nothing.
function writeSensors(sensors, silentS) {
  const rows = sensors.map(([sensor, pulse]) => {
    if (silentS === null) return { late: false, cells: [sensor, "–", "–", ""] };
    const failures = pulse.failures ? `failed ${pulse.failures}×` : "";
    const age = known(pulse.age_s) ? `${ago(pulse.age_s + silentS)}${pulse.late ? " late" : ""}` : "never";
    const rate = `${fixed(pulse.rate_hz, 0)}${known(pulse.wanted_hz) ? ` of ${pulse.wanted_hz}` : ""}`;
    return { late: pulse.late, cells: [sensor, age, rate, [pulse.note, failures].filter(Boolean).join(", ")] };
  });
  const body = element("sensor-rows");
  while (body.rows.length > rows.length) body.deleteRow(-1);
  rows.forEach(({ late, cells }, index) => {
    const row = body.rows[index] || body.insertRow();
    cells.forEach((text, column) => {
      const cell = row.cells[column] || row.insertCell();
      if (cell.textContent !== text) cell.textContent = text;
      cell.className = late && column === 1 ? "bad" : "";
    });
  });
}

function addLines(lines) {
  const list = element("lines");
  for (const [at, text, tone] of lines) {
    const item = document.createElement("li"), time = document.createElement("time"), said = document.createElement("span");
    time.textContent = at;
    said.textContent = text;
    item.className = tone;
    item.append(time, said);
    list.prepend(item);
  }
  while (list.children.length > LINES_SHOWN) list.lastChild.remove();
}
