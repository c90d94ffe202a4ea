"use strict";
const data = JSON.parse(document.getElementById("data").textContent);
const byId = (id) => document.getElementById(id);
const LINES = ["#0072B2", "#D55E00", "#009E73"];
const MAP = ["#00224e", "#123570", "#3b496c", "#575d6d", "#707173", "#8a8678", "#a59c74", "#c3b369", "#e1cc55", "#fee838"];
const state = { now: data.start, playing: false, speed: 1, last: 0, from: data.start, to: data.stop };
const listeners = [];

function element(tag, text, kind) {
  const made = document.createElement(tag);
  if (text !== undefined) made.textContent = text;
  if (kind) made.className = kind;
  return made;
}
const SUPER = { "-": "\u207B", 0: "\u2070", 1: "\u00B9", 2: "\u00B2", 3: "\u00B3", 4: "\u2074", 5: "\u2075",
  6: "\u2076", 7: "\u2077", 8: "\u2078", 9: "\u2079" };
const raised = (number) => [...String(number)].map((c) => SUPER[c] || c).join("");
function shown(value, digits = 6) {
  if (value === null || !Number.isFinite(value)) return "-";
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-4 || size >= 1e7)) {
    const [front, power] = value.toExponential(digits - 1).split("e");
    return Number(front) + " \u00B7 10" + raised(Number(power));
  }
  return String(Number(value.toPrecision(digits)));
}
/* Index of the last entry of a rising list that is not above a value. */
function before(list, value) {
  let low = 0, high = list.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (list[middle] <= value) low = middle; else high = middle - 1;
  }
  return low;
}
function between(times, now) {
  const first = before(times, now), second = Math.min(first + 1, times.length - 1);
  const gap = times[second] - times[first];
  return [first, second, gap > 0 ? Math.min(1, Math.max(0, (now - times[first]) / gap)) : 0];
}
function setTime(now) {
  state.now = Math.min(data.stop, Math.max(data.start, now));
  byId("time").value = state.now;
  byId("clock").textContent = "t = " + state.now.toFixed(data.digits) + " s";
  for (const listener of listeners) listener();
}
function prepared(canvas) {
  const ratio = window.devicePixelRatio || 1, box = canvas.getBoundingClientRect();
  const wide = Math.max(1, Math.round(box.width * ratio)), tall = Math.max(1, Math.round(box.height * ratio));
  if (canvas.width !== wide || canvas.height !== tall) { canvas.width = wide; canvas.height = tall; }
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, box.width, box.height);
  return [pen, box.width, box.height];
}

/* The moving sketch. */
const scene = data.scene;
const [left, right, lower, upper] = scene.limits;
const sketch = byId("sketch");
function sketchHeight() {
  const wide = sketch.clientWidth;
  const tall = wide * (upper - lower) / (right - left);
  sketch.style.height = Math.round(Math.min(Math.max(tall, 220), 0.62 * window.innerHeight)) + "px";
}
function pathSizes(path, order) {
  const values = data.outputs[path.output].values[order];
  return values[0].map((_, k) => values.every((c) => c[k] !== null) ? Math.hypot(...values.map((c) => c[k])) : null);
}
function colorOf(share) {
  return MAP[Math.min(MAP.length - 1, Math.max(0, Math.round(share * (MAP.length - 1))))];
}
let traced = [];
function choosePaths() {
  const order = Number(byId("paths").value);
  traced = order < 0 ? [] : scene.paths.map((path) => ({ path, sizes: order > 0 ? pathSizes(path, order) : null }));
  const sizes = traced.flatMap((trace) => trace.sizes || []).filter((size) => size !== null);
  const largest = sizes.reduce((a, b) => Math.max(a, b), 0) || 1;
  for (const trace of traced) trace.largest = largest;
  byId("legend").hidden = !sizes.length;
  if (sizes.length) {
    const output = data.outputs[scene.paths[0].output];
    byId("range").textContent = "0 to " + shown(largest, 4) + " " + unitText(output.units[order], 0);
    const pen = byId("colors").getContext("2d");
    for (let k = 0; k < 120; k += 1) { pen.fillStyle = colorOf(k / 119); pen.fillRect(k, 0, 1, 10); }
  }
  drawSketch();
}
function drawSketch() {
  const [pen, wide, tall] = prepared(sketch);
  const scale = Math.min(wide / (right - left), tall / (upper - lower));
  const x0 = wide / 2 - scale * (left + right) / 2, y0 = tall / 2 + scale * (lower + upper) / 2;
  const X = (x) => x0 + scale * x, Y = (y) => y0 - scale * y;
  const [first, second, share] = between(scene.times, state.now);
  const at = (points, count, k) => {
    if (points.length === 2 * count) return points.slice(2 * k, 2 * k + 2).map((v) => v * scene.step);
    const a = 2 * (first * count + k), b = 2 * (second * count + k);
    return [0, 1].map((c) => (points[a + c] + share * (points[b + c] - points[a + c])) * scene.step);
  };
  const print = Math.max(0.8, Math.min(1.6, wide / 480));
  const traces = () => {
    for (const { path, sizes, largest } of traced) {
      for (let k = 1; k < path.points.length / 2; k += 1) {
        const [a, b, c, d] = [0, 1, 2, 3].map((c) => path.points[2 * k - 2 + c]);
        if (a === null || c === null) continue;
        pen.beginPath();
        pen.moveTo(X(a * scene.step), Y(b * scene.step));
        pen.lineTo(X(c * scene.step), Y(d * scene.step));
        pen.lineWidth = (sizes ? 3 : 1.2) * print;
        pen.strokeStyle = sizes ? colorOf(sizes[k] / largest) : "#888888";
        pen.stroke();
      }
    }
  };
  pen.lineJoin = pen.lineCap = "round";
  let traces_due = true;
  for (const shape of scene.shapes) {
    if (traces_due && shape.layer >= 5) { traces(); traces_due = false; }
    pen.beginPath();
    if (shape.kind === "disc") {
      const [x, y] = at(shape.points, 1, 0);
      pen.arc(X(x), Y(y), shape.radius * scale, 0, 2 * Math.PI);
    } else {
      for (let k = 0; k < shape.count; k += 1) {
        const [x, y] = at(shape.points, shape.count, k);
        if (k) pen.lineTo(X(x), Y(y)); else pen.moveTo(X(x), Y(y));
      }
      if (shape.kind === "area") pen.closePath();
    }
    if (shape.fill) { pen.fillStyle = shape.fill; pen.fill(); }
    if (shape.stroke) {
      pen.setLineDash(shape.dashes.map((v) => v * shape.width * print));
      pen.lineWidth = shape.width * print;
      pen.strokeStyle = shape.stroke;
      pen.stroke();
    }
  }
  pen.setLineDash([]);
  if (traces_due) traces();
  if (byId("names").checked) drawNames(pen, wide, X, Y, at, scale);
  drawScale(pen, tall, scale);
  const solved = data.solved[before(data.times, state.now)];
  if (!solved) { pen.fillStyle = "#b22222"; pen.font = "600 14px sans-serif"; pen.textAlign = "left";
    pen.fillText("not solved at this time", 8, 20); }
}
function drawNames(pen, wide, X, Y, at, scale) {
  const size = wide < (scene.widths[0] + scene.widths[1]) / 2 ? 0 : 1, unit = scene.unit * scale;
  pen.textAlign = "center";
  pen.textBaseline = "middle";
  for (const label of scene.labels) {
    if (!label.places[size]) continue;
    const [across, up, far, led] = label.places[size], [x, y] = at(label.points, 1, 0);
    pen.font = (label.kind === "bodies" ? "600 " : label.kind === "outputs" ? "italic " : "") + "12px system-ui, sans-serif";
    const half = pen.measureText(label.text).width / 2 + 2;
    const edge = Math.min(half / Math.max(Math.abs(across), 1e-9), 8 / Math.max(Math.abs(up), 1e-9), Math.max(half, 8));
    const px = X(x) + across * (far * unit + edge), py = Y(y) - up * (far * unit + edge);
    if (led) {
      pen.lineWidth = 0.8;
      pen.strokeStyle = label.color;
      pen.beginPath(); pen.moveTo(X(x) + 1.2 * unit * across, Y(y) - 1.2 * unit * up); pen.lineTo(px, py); pen.stroke();
    }
    pen.lineWidth = 3;
    pen.strokeStyle = "rgba(255, 255, 255, 0.85)";
    pen.strokeText(label.text, px, py);
    pen.fillStyle = label.color;
    pen.fillText(label.text, px, py);
  }
}
function drawScale(pen, tall, scale) {
  pen.strokeStyle = pen.fillStyle = "#5b6570";
  pen.lineWidth = 2;
  pen.beginPath();
  pen.moveTo(8, tall - 7);
  pen.lineTo(8 + scene.bar * scale, tall - 7);
  pen.stroke();
  pen.font = "11px system-ui, sans-serif";
  pen.textAlign = "left";
  pen.textBaseline = "alphabetic";
  pen.fillText(scene.bar_text, 8, tall - 12);
}
listeners.push(drawSketch);

/* Time: play, stop, slide. */
function play(on) {
  state.playing = on;
  byId("play").textContent = on ? "\u275A\u275A" : "\u25B6";
  byId("play").setAttribute("aria-label", on ? "Stop" : "Play");
  if (!on) return;
  if (state.now >= data.stop) setTime(data.start);
  state.last = performance.now();
  requestAnimationFrame(tick);
}
function tick(clock) {
  if (!state.playing) return;
  let now = state.now + state.speed * Math.max(0, clock - state.last) / 1000;
  state.last = clock;
  if (now > data.stop) now = data.start + (now - data.stop) % Math.max(data.stop - data.start, 1e-12);
  setTime(now);
  requestAnimationFrame(tick);
}
byId("play").addEventListener("click", () => play(!state.playing));
byId("time").min = data.start;
byId("time").max = data.stop;
byId("time").addEventListener("input", (event) => { play(false); setTime(Number(event.target.value)); });
document.addEventListener("keydown", (event) => {
  if (["INPUT", "SELECT", "BUTTON"].includes(event.target.tagName)) return;
  if (event.key === " ") { event.preventDefault(); play(!state.playing); }
});
for (const [speed, text] of data.speeds) {
  const option = element("option", text);
  option.value = speed;
  byId("speed").append(option);
}
byId("speed").value = state.speed = data.speed;
byId("speed").addEventListener("change", (event) => { state.speed = Number(event.target.value); });
byId("names").addEventListener("change", drawSketch);
const choices = [[-1, "none"], [0, "plain"]];
if (scene.paths.length) data.outputs[scene.paths[0].output].words.forEach((word, k) => { if (k) choices.push([k, word]); });
for (const [value, text] of choices) {
  const option = element("option", value > 0 ? "colored by " + text : text);
  option.value = value;
  byId("paths").append(option);
}
byId("paths").value = scene.paths.length ? 0 : -1;
byId("paths").disabled = !scene.paths.length;
byId("paths").addEventListener("change", choosePaths);
