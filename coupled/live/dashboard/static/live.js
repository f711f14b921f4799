"use strict";
// The page: draws rows and state of the flight, and sends the user's requests.

const FLIGHT = 9, PER = 6, HISTORY_s = 60, LOOP_s = 10;
const by = id => document.getElementById(id);
const token = document.body.dataset.token;
const wire = new WebSocket(`ws://${location.host}/ws?token=${encodeURIComponent(token)}`);
wire.binaryType = "arraybuffer";
const say = word => { if (wire.readyState === 1) wire.send(JSON.stringify({ text: "", control: "", value: 0, ...word })); };

let setup = null, state = {}, chosen = 0, rows = [], plot = null, fresh = false;
const width = () => FLIGHT + PER * setup.controls.length;
const shownUnit = c => c.unit === "rad" ? "°" : "mm";
const factor = c => c.unit === "rad" ? 180 / Math.PI : 1000;
const at = (row, what) => row[FLIGHT + PER * chosen + what];  // 0 F, 1 δc, 2 δ, 3 δ̂, 4 G_T, 5 F_mod

wire.onmessage = message => {
  if (typeof message.data === "string") { take(JSON.parse(message.data)); return; }
  if (!setup) return;
  const values = new Float32Array(message.data), w = width();
  for (let i = 0; i + w <= values.length; i += w) rows.push(values.subarray(i, i + w));
  const most = Math.round(HISTORY_s / setup.frame_s);
  if (rows.length > 1.2 * most) rows = rows.slice(-most);
  fresh = true;
};
wire.onclose = () => {
  if (state.phase !== "done") warn(["The host has gone: the flight has ended, or the connection is lost."]);
  by("phase").textContent = "no connection"; by("phase").className = "pill bad";
};

function take(given) {
  state = given;
  if (given.setup && !setup) begin(given.setup);
  warn(given.warnings || []);
  const lost = given.lost, over = ["ended", "diagnosing", "done"].includes(given.phase);
  by("phase").textContent = lost ? "loader lost" : given.phase;
  by("phase").className = "pill" + (lost ? " bad" : over ? " over" : "");
  for (const id of ["mark", "save", "stop"]) by(id).disabled = over;
  if (setup) { switches(); services(); service(); late(); wireTime(); }
  if (over) found();
}

const warn = texts => { by("warnings").textContent = texts.slice(-3).join("\n"); };

function begin(given) {
  setup = given;
  by("run").textContent = `${setup.run} · ${setup.loader === "sim" ? "simulated loader" : setup.loader}`;
  setup.controls.forEach((c, i) => by("control").add(new Option(c.name, i)));
  by("control").hidden = setup.controls.length < 2;
  by("control").onchange = () => { chosen = +by("control").value; built = ""; history(); switches(); service(); };
  by("attitude-box").hidden = !setup.flown;
  by("hand-box").hidden = setup.hand !== "page";
  history();
}

function history() {
  const c = setup.controls[chosen], box = by("history");
  box.replaceChildren();
  const series = (label, stroke) => ({ label, stroke: colour(stroke), width: 1.4, points: { show: false } });
  const axis = { stroke: colour("--soft"), grid: { stroke: colour("--line") }, ticks: { stroke: colour("--line") } };
  plot = new uPlot({
    width: box.clientWidth, height: 225, cursor: { show: false }, pxAlign: 0,
    scales: { x: { time: false } },
    axes: [{ ...axis, size: 26 }, { ...axis, size: 44, label: shownUnit(c), labelSize: 18 }],
    series: [{ label: "time, s" }, series("δ", "--one"), series("δc", "--two"), series("δ̂", "--three")],
    legend: { live: false },
  }, [[], [], [], []], box);
  fresh = true;
}
addEventListener("resize", () => { if (plot) history(); });

const breakoutOf = c => state.switches && state.switches[c.name] ? state.switches[c.name].breakout : 0;
const num = (v, digits) => Number.isFinite(v) ? v.toFixed(digits).replace("-", "−") : "—";
function list(id, pairs) {
  by(id).innerHTML = "";
  for (const [name, value, bad] of pairs) {
    const dt = document.createElement("dt"), dd = document.createElement("dd");
    dt.textContent = name; dd.textContent = value; if (bad) dd.className = "bad";
    by(id).append(dt, dd);
  }
}

function draw() {
  requestAnimationFrame(draw);
  if (!fresh || !rows.length) return;
  fresh = false;
  const c = setup.controls[chosen], f = factor(c), unit = shownUnit(c), last = rows.at(-1), T = setup.frame_s;
  by("clock").textContent = `${num(last[0] * T, 1)} s`;
  const near = rows.slice(-Math.round(LOOP_s / T));
  drawLoop(near.map(r => f * at(r, 2)), near.map(r => at(r, 0)), at(last, 4) / f, breakoutOf(c), f * c.travel, unit);
  plot.setData([rows.map(r => r[0] * T), ...[2, 1, 3].map(n => rows.map(r => f * at(r, n)))]);
  drawSchedule(c.pressure_Pa, c.gradient.map(g => g / f), last[2], at(last, 4) / f, unit);
  const held = Math.abs(at(last, 2)) > 0.03 * c.travel;
  const lost = held ? 100 * (1 - at(last, 3) / at(last, 2)) : NaN;
  list("now", [
    ["force F", `${num(at(last, 0), 1)} N`], ["deflection δ", `${num(f * at(last, 2), 2)} ${unit}`],
    ["computed δc", `${num(f * at(last, 1), 2)} ${unit}`], ["host's δ̂", `${num(f * at(last, 3), 2)} ${unit}`],
    ["authority lost now", held ? `${num(lost, 1)} %` : "—", Math.abs(lost) > 5],
    ["felt / specified gradient", held ? num(at(last, 0) / at(last, 2) / at(last, 4), 3) : "—"],
    ["F_mod", `${num(at(last, 5), 1)} N`], ["G_T", `${num(at(last, 4) / f, 3)} N/${unit}`],
    ["q̄", `${num(last[2] / 1000, 2)} kPa`], ["this frame late by", `${num(last[1], 3)} ms`],
  ]);
  if (setup.flown) {
    drawAttitude(last[3], last[4]);
    const deg = 180 / Math.PI;
    by("motion").textContent = `pitch ${num(deg * last[4], 1)}° · roll ${num(deg * last[3], 1)}° · `
      + `${num(last[7], 1)} m/s · ${num(last[6], 0)} m · ${num(last[8], 2)} g`;
  }
}

let offered = "";
function services() {
  const c = setup.controls[chosen], given = (state.services || {})[c.name];
  by("services-box").hidden = !given;
  if (!given) return;
  const names = Object.keys(given), key = c.name + names.join();
  const inYesNo = name => !/_(m|rad|N)$/.test(name);
  if (offered !== key) {
    by("services").replaceChildren(...names.map(name => {
      const label = document.createElement("label"), input = document.createElement("input");
      const unit = (name.match(/_(m|rad|N)$/) || ["", ""])[1];
      label.append(name.replace(/_(m|rad|N)$/, "").replaceAll("_", " ") + (unit ? `, ${unit}` : ""), input);
      input.type = inYesNo(name) ? "checkbox" : "number"; input.step = "any"; input.id = `service-${name}`;
      input.onchange = () => say({ what: "service", control: c.name, text: name, value: inYesNo(name) ? +input.checked : +input.value });
      return label;
    }));
    offered = key;
  }
  for (const name of names) {
    const input = by(`service-${name}`);
    input.disabled = state.phase !== "flying";
    if (document.activeElement === input && !inYesNo(name)) continue;
    if (inYesNo(name)) input.checked = given[name] > 0.5; else input.value = +given[name].toPrecision(5);
  }
}

let built = "";
function switches() {
  const c = setup.controls[chosen], now = state.switches && state.switches[c.name];
  if (!now) return;
  const kinds = [
    ["deflection", "deflection correction", "", 1, true], ["gradient", "gradient correction", "", 1, true],
    ["assumed_bend", "host's K̂", `10⁻⁶ ${c.unit}/N`, 1e6], ["bend", "real K", `10⁻⁶ ${c.unit}/N`, 1e6],
    ["friction", "friction", "N", 1], ["breakout", "breakout", "N", 1],
  ].filter(([what]) => setup.loader === "sim" || !["bend", "friction", "breakout"].includes(what));
  if (built !== c.name) {
    by("switches").replaceChildren(...kinds.map(([what, name, unit, scale, yes]) => {
      const label = document.createElement("label"), input = document.createElement("input");
      const text = document.createElement("span"), small = document.createElement("small");
      text.textContent = name + " "; small.textContent = unit; text.append(small);
      input.type = yes ? "checkbox" : "number"; input.id = `switch-${what}`; input.step = "any"; input.min = 0;
      input.onchange = () => say({ what: "set", control: c.name, text: what, value: yes ? +input.checked : +input.value / scale });
      label.append(text, input); return label;
    }));
    built = c.name;
  }
  for (const [what, , , scale, yes] of kinds) {
    const input = by(`switch-${what}`);
    input.disabled = state.phase !== "flying";
    if (document.activeElement === input && !yes) continue;
    if (yes) input.checked = now[what]; else input.value = +(now[what] * scale).toPrecision(6);
  }
}

function service() {
  const c = setup.controls[chosen], k = state.service && state.service[c.name];
  if (!k) { list("service", [["not estimated", "δ is not measured, or K̂ is 0"]]); return; }
  const micro = v => v === null || v === undefined ? "—" : num(1e6 * v, 2);
  list("service", [
    [`K found, 10⁻⁶ ${c.unit}/N`, micro(k.bend), k.alarm], ["95 % interval", k.bend === null ? "—" : `${micro(k.low)} to ${micro(k.high)}`],
    ["calibrated", micro(state.calibrated[c.name])], ["excitation: F varies by", `${num(k.excitation_N, 1)} N`],
    ["learning", k.frozen ? "frozen: the hand does too little" : "yes"],
    ["alarm", k.alarm ? "K has left the calibrated one" : "none", k.alarm], ["adapts K̂", state.adapt ? "yes" : "no"],
  ]);
}

function wireTime() {
  const r = state.round_trip;
  by("wire").hidden = !r;
  if (r) by("wire").textContent = `round trip to the loader${r.stamped ? "" : ", with the wait for the next frame"}: `
    + `p50 ${num(r.p50_ms, 3)} ms · p99 ${num(r.p99_ms, 3)} ms · largest ${num(r.largest_ms, 3)} ms`;
}

function late() {
  const l = state.lateness;
  if (!l) { by("late").textContent = "lock-step: no deadlines"; return; }
  drawLateness(l.histogram_from_ms, l.histogram_frames);
  by("late").textContent = `p50 ${num(l.late_p50_ms, 3)} ms · p99 ${num(l.late_p99_ms, 3)} ms · largest ${num(l.late_largest_ms, 3)} ms · `
    + `over a frame ${l.late_over_a_frame} · work ${num(l.work_p50_ms, 2)} of ${num(l.frame_ms, 2)} ms · packets dropped ${state.dropped}`;
}

let shown = "";
function found() {
  const key = JSON.stringify([state.phase, state.record, state.diagnosis]);
  if (key === shown) return;
  shown = key; by("found-box").hidden = false; by("found").replaceChildren();
  const add = (text, tag = "p") => { const e = document.createElement(tag); e.textContent = text; by("found").append(e); return e; };
  if (state.record) add(`Record: ${state.record}`);
  if (state.phase === "diagnosing") add("Held against its rig; this takes some seconds …");
  const d = state.diagnosis;
  if (d) {
    add(d.summary).id = "verdict";
    const table = add("", "table");
    for (const cells of d.rows) {
      const row = table.insertRow();
      for (const cell of cells) row.insertCell().textContent = cell;
    }
  }
}

by("mark").onclick = () => say({ what: "mark", text: "" });
by("save").onclick = () => say({ what: "save" });
by("stop").onclick = () => say({ what: "stop" });
by("leave").onclick = () => { say({ what: "leave" }); by("leave").disabled = true; };
addEventListener("keydown", e => { if (e.key === "Escape" && state.phase === "flying") say({ what: "stop" }); });

// The hand: column down is a pull, wheel to the right, pedals by A and D.
const hand = { column: 0, wheel: 0, pedals: 0 }, keys = new Set();
let drag = false;
function moved() {
  const knob = by("pad").firstElementChild;
  knob.style.left = `${50 + 50 * hand.wheel}%`; knob.style.top = `${50 + 50 * hand.column}%`;
  for (const c of setup.controls) say({ what: "hand", control: c.name, value: hand[c.name] });
}
const within = v => Math.max(-1, Math.min(1, v));
by("pad").onpointerdown = e => { drag = true; by("pad").setPointerCapture(e.pointerId); point(e); };
by("pad").onpointermove = e => { if (drag) point(e); };
by("pad").onpointerup = by("pad").onpointercancel = () => { drag = false; hand.column = hand.wheel = 0; moved(); };
function point(e) {
  const box = by("pad").getBoundingClientRect();
  hand.wheel = within(2 * (e.clientX - box.left) / box.width - 1);
  hand.column = within(2 * (e.clientY - box.top) / box.height - 1); moved();
}
const pulls = { ArrowDown: ["column", 1], ArrowUp: ["column", -1], ArrowRight: ["wheel", 1], ArrowLeft: ["wheel", -1], d: ["pedals", 1], a: ["pedals", -1] };
by("pad").onkeydown = e => { if (pulls[e.key]) { keys.add(e.key); e.preventDefault(); } };
by("pad").onkeyup = e => keys.delete(e.key);
by("pad").onblur = () => keys.clear();
setInterval(() => {
  if (!setup || drag || setup.hand !== "page") return;
  const wanted = { column: 0, wheel: 0, pedals: 0 };
  for (const key of keys) wanted[pulls[key][0]] += 0.5 * pulls[key][1];
  let any = false;
  for (const name in hand) {
    const next = hand[name] + Math.max(-0.05, Math.min(0.05, wanted[name] - hand[name]));
    any ||= next !== hand[name]; hand[name] = next;
  }
  if (any) moved();
}, 33);
requestAnimationFrame(draw);
