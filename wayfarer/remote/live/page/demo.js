// A demo: its one sentence, its buttons, and what to do next at its end. The page of a rover shows none of them.

const times = (speed) => (speed === 1 ? "in real time" : `${Number(speed.toPrecision(3))} times as fast`);

function writeDemo(demo, ended) {
  element("demo").hidden = !demo;
  element("next").hidden = !demo || !ended;
  if (!demo) return;
  write("pace", demo.paused ? "Paused." : `Shown ${times(demo.speed)}.`);
  write("pause", demo.paused ? "Go on" : "Pause the clock");
  write("seed", `seed ${demo.seed}`);
  write("next-report", `wayfarer report ${demo.log}`);
  write("next-log", `wayfarer logs show ${demo.log}`);
  for (const button of element("speeds").children) {
    button.setAttribute("aria-pressed", Number(button.dataset.times) === demo.speed);
  }
}

// Without a connection nothing can be asked for, and after the run there is no time that could be paused or go faster.
function enableDemo(connected, ended) {
  for (const button of element("demo").querySelectorAll("button")) button.disabled = !connected || ended;
}

function askDemo(request) {
  if (!connection.send(request)) say("Not sent: there is no connection to the demo.");
}

function prepareDemo() {
  element("pause").onclick = () => askDemo({ do: model.state.demo.paused ? "play" : "pause" });
  for (const button of element("speeds").children) {
    button.onclick = () => askDemo({ do: "speed", times: Number(button.dataset.times) });
  }
}
