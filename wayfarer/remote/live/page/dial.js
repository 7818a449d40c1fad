// The heading dial.

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
