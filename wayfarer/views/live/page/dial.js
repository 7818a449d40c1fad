// The heading dial, and the strip of phases.

const STRIP_S = 120;

function prepareDial() {
  for (let degrees = 0; degrees < 360; degrees += 30) {
    const tick = document.createElementNS("http://www.w3.org/2000/svg", "line");
    tick.setAttribute("y1", -50);
    tick.setAttribute("y2", -45);
    tick.setAttribute("transform", `rotate(${degrees})`);
    element("dial-ticks").append(tick);
  }
}

function turn(id, degrees) {
  element(id).setAttribute("visibility", known(degrees) ? "visible" : "hidden");
  if (known(degrees)) element(id).setAttribute("transform", `rotate(${degrees})`);
}

function drawDial(state) {
  turn("dial-heading", state.heading_deg);
  turn("dial-goal", state.goal_heading_deg);
  element("dial").setAttribute("aria-label", `Heading ${whole(state.heading_deg)}, goal ${whole(state.goal_heading_deg)}`);
}

function drawStrip(canvas, phases, nowS) {
  const { pen, width, height } = sharp(canvas);
  const x = (t) => width * Math.max(0, 1 - (nowS - t) / STRIP_S);
  phases.forEach(([t, phase], index) => {
    const ends = index + 1 < phases.length ? phases[index + 1][0] : nowS;
    if (ends < nowS - STRIP_S) return;
    pen.fillStyle = colour(phase in PHASES ? phase : "halt");
    pen.fillRect(x(t), 0, x(ends) - x(t), height);
  });
}
