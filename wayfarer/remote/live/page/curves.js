// Heading and counter C over time, and the strip of phases below them: the last two minutes, now at the right.

const STRIP_S = 120;
const TURN_DEG = 360;
const LEAST_C_DEG = 180; // that the axis of C shows; it grows by whole turns
const LABELS_PX = 44; // beside the curves, for their numbers

const across = (width, nowS) => (t) => LABELS_PX + (width - LABELS_PX) * Math.max(0, 1 - (nowS - t) / STRIP_S);

function drawCurves(canvas, course, state) {
  const { pen, width, height } = sharp(canvas);
  const seen = course.filter(([t]) => t >= state.t_s - STRIP_S);
  const x = across(width, state.t_s), half = height / 2;
  const farthest = Math.max(LEAST_C_DEG, ...seen.map(([, , counter]) => Math.abs(counter ?? 0)));
  const most = farthest === LEAST_C_DEG ? LEAST_C_DEG : Math.ceil(farthest / TURN_DEG) * TURN_DEG;
  drawCurve(pen, { top: 0, height: half, width, x, most: 180 }, "off the goal", "follow", seen.map(([t, off]) => [t, off]));
  drawCurve(pen, { top: half, height: half, width, x, most }, "counter C", "probe", seen.map(([t, , counter]) => [t, counter]));
  const [, off, counter] = course.at(-1) ?? [];
  canvas.setAttribute("aria-label", `Over the last two minutes: heading, now ${signed(off)} off the goal, and counter C, now ${signed(counter)}`);
}

// One curve with its axis from -most to most; it breaks where it wraps, and where nothing is known.
function drawCurve(pen, { top, height, width, x, most }, name, hue, points) {
  const pad = 9, y = (value) => top + height / 2 - (value / most) * (height / 2 - pad);
  pen.lineWidth = 1;
  pen.font = "12px system-ui, sans-serif";
  pen.textAlign = "right";
  for (const value of [most, 0, -most]) {
    pen.strokeStyle = colour("edge");
    pen.globalAlpha = value ? 0.4 : 1;
    pen.beginPath();
    pen.moveTo(LABELS_PX, y(value));
    pen.lineTo(width, y(value));
    pen.stroke();
    pen.globalAlpha = 1;
    pen.fillStyle = colour("ink-2");
    pen.fillText(signed(value), LABELS_PX - 5, y(value) + 4);
  }
  pen.strokeStyle = colour(hue);
  pen.lineWidth = 2;
  pen.lineJoin = "round";
  pen.beginPath();
  let before = null;
  for (const [t, value] of points) {
    if (known(value)) {
      const follows = known(before) && Math.abs(value - before) <= TURN_DEG / 2;
      pen[follows ? "lineTo" : "moveTo"](x(t), y(value));
    }
    before = value;
  }
  pen.stroke();
  label(pen, name, LABELS_PX + 4, top + 18, "left");
}

function drawStrip(canvas, phases, nowS) {
  const { pen, width, height } = sharp(canvas);
  const x = across(width, nowS);
  phases.forEach(([t, phase], index) => {
    const ends = index + 1 < phases.length ? phases[index + 1][0] : nowS;
    if (ends < nowS - STRIP_S) return;
    pen.fillStyle = colour(phase in PHASES ? phase : "halt");
    pen.fillRect(x(t), 0, x(ends) - x(t), height);
  });
}
