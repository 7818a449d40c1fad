// What is known of the run, and what happens when more of it comes, when time passes, and when somebody presses a button.

const OLD_S = 1; // ten states come a second: what is older than this must not look alive
const REPLY_S = 6; // long enough to read a refusal twice
const ANSWER_S = 2; // an answer that takes longer is missed
const KEPT = { track: 8000, marks: 400, phases: 400, course: 600 }; // as the server keeps; it sends a thinner track in time

const model = { about: {}, forest: null, track: [], marks: [], phases: [], course: [], outcome: null, state: null, mayStart: false };
const connection = new Connection(take, takeToken());
let drawing = false;
let unsaid; // the timer of what is said about the last request
let looked = false; // for a new run, after the end of this one

// Takes the token out of the address. It stays in this tab, for this port: a cookie would go to other ports as well, where
// another user may listen.
function takeToken() {
  const given = new URLSearchParams(location.search).get("token") ?? "";
  history.replaceState(null, "", location.pathname);
  try {
    if (given) sessionStorage.setItem("token", given);
    return sessionStorage.getItem("token") ?? "";
  } catch {
    return given; // this browser keeps nothing
  }
}

function take(piece) {
  if (piece.snapshot) takeSnapshot(piece.snapshot);
  if (piece.news) takeNews(piece.news);
  if (piece.state) model.state = piece.state;
  if (piece.reply) takeReply(piece.reply);
  if ("may_start" in piece) model.mayStart = piece.may_start;
  connection.ended = model.outcome !== null;
  redraw();
}

function takeSnapshot(snapshot) {
  const { lines, ...rest } = snapshot;
  Object.assign(model, rest);
  looked = false;
  zoom.middle = null; // another run may be elsewhere
  say("");
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
  if (reply.do?.startsWith("manual_")) return takeManual(reply);
  const held = reply.held === false ? "Stopped: nobody drives by hand any more" : "Held";
  const done = { stop: "Stopped", hold: held, resume: "Resumed", mark: "Noted" };
  say(reply.ok ? done[reply.do] ?? "" : `Not done: ${reply.why}`); // a demo's buttons show what they did
}

// Says what became of a request, and `next` after a while.
function say(text, afterS = REPLY_S, next = "") {
  clearTimeout(unsaid);
  write("reply", text);
  unsaid = setTimeout(() => write("reply", next), afterS * 1000);
}

function redraw() {
  if (drawing || !model.state) return;
  drawing = true;
  requestAnimationFrame(() => {
    drawing = false;
    writeState(model.state, model.mayStart);
    writeLegend(model);
    writeDemo(model.state.demo, model.outcome !== null);
    drawDial(model.state);
    drawMap(element("map"), model);
    drawCurves(element("curves"), model.course, model.state);
    drawStrip(element("strip"), model.phases, model.state.t_s);
    watchAge();
  });
}

// Whether what the page shows is how things are.
function isFresh() {
  return connection.isOpen && connection.silentS !== null && connection.silentS <= OLD_S;
}

// Tells how old everything is, and makes it look so.
function watchAge() {
  connection.mind();
  const silentS = connection.silentS;
  const isOld = !model.outcome && !isFresh();
  document.body.classList.toggle("stale", isOld);
  document.body.classList.toggle("ended", model.outcome !== null);
  write("age", ageText(isOld, silentS));
  if (model.state) writeSensors(model.state.sensors, model.outcome ? null : silentS);
  for (const id of ["resume", "send-mark"]) element(id).disabled = isOld; // what waits in a dead connection is done later, unseen
  showHowToArm(isOld);
  enableDemo(connection.isOpen, model.outcome !== null);
  showManual();
  showBanner(isOld, silentS);
}

function ageText(isOld, silentS) {
  if (silentS === null) return "connecting";
  if (model.outcome) return "the run is over";
  if (isOld) return `old: ${ago(silentS)} ago`;
  return model.state.demo?.paused ? "paused" : `live, ${ago(silentS)} ago`;
}

// In place of Hold while there is nothing to hold; a page that is old knows nothing of that.
function showHowToArm(isOld) {
  const isHint = !isOld && model.state?.mode === "disarmed" && !model.state.demo;
  element("hold").hidden = isHint;
  element("how-to-arm").hidden = !isHint;
}

function showBanner(isOld, silentS) {
  const banner = element("banner");
  banner.hidden = !isOld && !model.outcome;
  banner.className = model.outcome ? (ENDS[model.outcome.reason] ?? "") : "";
  element("again").hidden = connection.isOpen && !(model.outcome && !model.state.demo);
  write("again", model.outcome ? "Look for a new run" : "Try now");
  if (model.outcome) write("banner-text", `The run has ended: ${model.outcome.text}${totalsText(model.state)}.${afterwards()}`);
  else if (isOld) write("banner-text", lostText(silentS));
}

// How far the rover of a demo drove and for how long.
function totalsText(state) {
  return state.demo ? `, ${fixed(state.way_m, 1, " m")} driven in ${state.time_text}` : "";
}

function afterwards() {
  if (looked) return " There is no new one yet.";
  return model.state.demo && !connection.isOpen ? " The demo is closed: wayfarer demo starts it again." : "";
}

function lostText(silentS) {
  const old = silentS === null ? "" : ` What you see is ${ago(silentS)} old.`;
  if (connection.isOpen) return `No data from the rover.${old}`;
  const next = connection.pauseS > 0 ? ` Next try in ${Math.ceil(connection.pauseS)} s.` : " Trying.";
  const mayLackToken = connection.failures > 3 || (!old && !connection.token); // on another computer it is refused
  const address = mayLackToken ? " If wayfarer was restarted, or runs on another computer, open the address that it printed." : "";
  return `No connection to the rover.${old}${next}${address}`;
}

function ask(request, said) {
  if (connection.send(request)) say(`${said}: asked`, ANSWER_S, `${said}: no answer yet`);
  else say("Not sent: there is no connection to the rover.");
}

// For what must not be done later, when nobody watches: the age is taken at the press, not when it was last drawn.
function askFresh(request, said) {
  if (isFresh()) ask(request, said);
  else say("Not sent: what the page shows is old.");
}

element("stop").onclick = () => ask({ do: "stop" }, "Stop");
element("hold").onclick = () => ask({ do: "hold" }, "Hold");
element("resume").onclick = () => askFresh({ do: "resume", asked_s: model.state.now_s }, "Resume");
element("mark-form").onsubmit = (event) => {
  event.preventDefault();
  const text = element("mark").value.trim();
  if (text) askFresh({ do: "mark", text }, "Mark");
  if (text && isFresh()) element("mark").value = "";
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

prepareDial();
prepareMap(element("map"));
prepareDemo();
prepareManual();
setInterval(watchAge, 250);
connection.open();
