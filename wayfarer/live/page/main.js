// What is known of the run, and what happens when more of it comes, when time passes, and when somebody presses a button.

const OLD_S = 1; // ten states come a second: what is older than this must not look alive
const KEPT = { track: 8000, marks: 400, phases: 400 }; // as the server keeps; it sends a thinner track in time

const model = { about: {}, forest: null, track: [], marks: [], phases: [], outcome: null, state: null };
const connection = new Connection(take);
let drawing = false;
let looked = false; // for a new run, after the end of this one

function take(piece) {
  if (piece.snapshot) takeSnapshot(piece.snapshot);
  if (piece.news) takeNews(piece.news);
  if (piece.state) model.state = piece.state;
  if (piece.reply) takeReply(piece.reply);
  connection.ended = model.outcome !== null;
  redraw();
}

function takeSnapshot(snapshot) {
  const { lines, ...rest } = snapshot;
  Object.assign(model, rest);
  looked = false;
  element("lines").replaceChildren();
  addLines(lines);
  writeAbout(model.about);
}

function takeNews(news) {
  for (const kind of Object.keys(KEPT)) {
    if (news[kind]) model[kind].push(...news[kind]);
    if (model[kind].length > KEPT[kind]) model[kind].splice(0, model[kind].length - KEPT[kind]);
  }
  if (news.whole_track) model.track = news.whole_track;
  if (news.lines) addLines(news.lines);
  if (news.outcome) model.outcome = news.outcome;
}

function takeReply(reply) {
  const done = { stop: "Stopped", hold: "Held", resume: "Going on", mark: "Noted" };
  write("reply", reply.ok ? done[reply.do] : `Not done: ${reply.why}`);
}

function redraw() {
  if (drawing || !model.state) return;
  drawing = true;
  requestAnimationFrame(() => {
    drawing = false;
    writeState(model.state);
    writeLegend(model.track);
    drawDial(model.state);
    drawMap(element("map"), model);
    drawStrip(element("strip"), model.phases, model.state.t_s);
    watchAge();
  });
}

// Tells how old everything is, and makes it look so.
function watchAge() {
  connection.mind();
  const silentS = connection.silentS;
  const isOld = !model.outcome && (silentS === null || silentS > OLD_S || !connection.isOpen);
  document.body.classList.toggle("stale", isOld);
  document.body.classList.toggle("ended", model.outcome !== null);
  write("age", silentS === null ? "connecting" : model.outcome ? "the run is over" : `${isOld ? "old: " : "live, "}${ago(silentS)} ago`);
  if (model.state) writeSensors(model.state.sensors, model.outcome ? 0 : silentS);
  showBanner(isOld, silentS);
}

function showBanner(isOld, silentS) {
  const banner = element("banner");
  banner.hidden = !isOld && !model.outcome;
  banner.className = model.outcome ? (model.outcome.reason === "failed" ? "failed" : "ended") : "";
  element("again").hidden = !model.outcome && connection.isOpen;
  write("again", model.outcome ? "Look for a new run" : "Try now");
  if (model.outcome) write("banner-text", `The run has ended: ${model.outcome.text}.${looked ? " There is no new one yet." : ""}`);
  else if (isOld) write("banner-text", lostText(silentS));
}

function lostText(silentS) {
  const old = silentS === null ? "" : ` What you see is ${ago(silentS)} old.`;
  if (connection.isOpen) return `The rover says nothing.${old}`;
  const next = connection.pauseS > 0 ? ` Next try in ${Math.ceil(connection.pauseS)} s.` : " Trying.";
  const anew = connection.failures > 3 ? " If wayfarer was started anew, open the address that it printed." : "";
  return `No connection to the rover.${old}${next}${anew}`;
}

function ask(request, said) {
  write("reply", connection.send(request) ? said : "Not sent: there is no connection to the rover.");
}

element("stop").onclick = () => ask({ do: "stop" }, "Stopping");
element("hold").onclick = () => ask({ do: model.state?.held ? "resume" : "hold" }, "Asked");
element("mark-form").onsubmit = (event) => {
  event.preventDefault();
  const text = element("mark").value.trim();
  if (text) ask({ do: "mark", text }, "Sent");
  if (text && connection.isOpen) element("mark").value = "";
};
element("again").onclick = () => {
  looked = model.outcome !== null;
  connection.open();
};
addEventListener("resize", redraw);
addEventListener("offline", () => connection.lose());
addEventListener("online", () => connection.isOpen || connection.ended || connection.open());
document.addEventListener("visibilitychange", () => document.hidden || connection.isOpen || connection.ended || connection.open());
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);

history.replaceState(null, "", location.pathname); // the token has done its work
prepareDial();
setInterval(watchAge, 250);
connection.open();
