/* Outputs over time: one panel for each chosen output and derivative. */
const panels = [], NARROW = 480; // pixels, below which values stand below the title of a panel
function niceStep(span, count) {
  const rough = span / Math.max(count, 1), power = 10 ** Math.floor(Math.log10(rough));
  return power * [1, 2, 2.5, 5, 10].find((k) => k * power >= rough * (1 - 1e-9));
}
function ticks(low, high, count) {
  const step = niceStep(high - low, count), found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k += 1) found.push(k * step);
  return [found, step];
}
function tickText(value, step) {
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9) + (String(step).includes("25") ? 1 : 0));
  return Math.abs(value) < step * 1e-6 ? "0" : value.toFixed(Math.min(digits, 12));
}
function rangeOf(lines, first, last) {
  let low = Infinity, high = -Infinity, size = 0;
  for (const line of lines) for (let k = first; k <= last; k += 1) if (line[k] !== null) {
    low = Math.min(low, line[k]); high = Math.max(high, line[k]); size = Math.max(size, Math.abs(line[k]));
  }
  if (low > high) return [-1, 1];
  const pad = high - low <= 1e-9 * size || size === 0 ? 0.1 * size || 1 : 0.08 * (high - low);
  return [low - pad, high + pad];
}
function scaleOf(low, high) {
  const size = Math.max(Math.abs(low), Math.abs(high));
  return size === 0 || (size >= 0.01 && size < 2000) ? 0 : 3 * Math.floor(Math.log10(size) / 3);
}
function unitText(unit, exponent) {
  const text = unit.replace(/\^(-?\d+)/g, (_, power) => raised(power)).replace(/\*/g, " ");
  return exponent ? "10" + raised(exponent) + " " + text : text;
}
class Panel {
  constructor(output, order) {
    Object.assign(this, { output, order, lines: output.values[order], hover: null, drag: null });
    this.box = element("div", undefined, "panel");
    this.canvas = element("canvas");
    this.canvas.setAttribute("aria-label", output.name + ", " + output.words[order]);
    this.box.append(this.canvas);
    this.canvas.addEventListener("pointermove", (event) => this.move(event));
    this.canvas.addEventListener("pointerleave", () => { this.hover = null; this.draw(); });
    this.canvas.addEventListener("pointerdown", (event) => {
      this.drag = { from: this.timeAt(event), x: event.offsetX };
      this.canvas.setPointerCapture(event.pointerId);
    });
    this.canvas.addEventListener("pointerup", (event) => this.release(event));
    this.canvas.addEventListener("dblclick", () => zoom(data.start, data.stop));
  }
  timeAt(event) {
    const { x0, x1 } = this.frame;
    const share = Math.min(1, Math.max(0, (event.offsetX - x0) / (x1 - x0)));
    return state.from + share * (state.to - state.from);
  }
  move(event) {
    this.hover = this.timeAt(event);
    if (this.drag) this.drag.to = Math.abs(event.offsetX - this.drag.x) > 5 ? this.hover : undefined;
    this.draw();
  }
  release(event) {
    const drag = this.drag;
    this.drag = null;
    if (!drag) return;
    const to = this.timeAt(event);
    if (Math.abs(event.offsetX - drag.x) > 5) zoom(Math.min(drag.from, to), Math.max(drag.from, to));
    else { play(false); setTime(to); }
  }
  draw() {
    const [pen, wide, tall] = prepared(this.canvas);
    const { output, order, lines } = this, narrow = wide < NARROW;
    const frame = { x0: 62, x1: wide - 12, y0: narrow ? 40 : 24, y1: tall - 20 };
    this.frame = frame;
    const first = before(data.times, state.from), last = Math.min(before(data.times, state.to) + 1, data.times.length - 1);
    const [low, high] = rangeOf(lines, first, last), exponent = scaleOf(low, high), factor = 10 ** exponent;
    const span = state.to - state.from || 1;
    const X = (t) => frame.x0 + (t - state.from) / span * (frame.x1 - frame.x0);
    const Y = (v) => frame.y1 - (v - low) / (high - low) * (frame.y1 - frame.y0);
    pen.font = "11px system-ui, sans-serif";
    pen.lineWidth = 1;
    const [vertical, step] = ticks(low / factor, high / factor, 4), [horizontal, pace] = ticks(state.from, state.to, 6);
    pen.textBaseline = "middle";
    pen.textAlign = "right";
    for (const value of vertical) {
      const y = Y(value * factor);
      pen.strokeStyle = Math.abs(value) < step * 1e-6 ? "#9aa3ab" : "#e6e9ec";
      pen.beginPath(); pen.moveTo(frame.x0, y); pen.lineTo(frame.x1, y); pen.stroke();
      pen.fillStyle = "#5b6570";
      pen.fillText(tickText(value, step), frame.x0 - 6, y);
    }
    pen.textBaseline = "top";
    pen.textAlign = "center";
    for (const value of horizontal) {
      pen.strokeStyle = "#e6e9ec";
      pen.beginPath(); pen.moveTo(X(value), frame.y0); pen.lineTo(X(value), frame.y1); pen.stroke();
      pen.fillStyle = "#5b6570";
      if (X(value) < frame.x1 - 40) pen.fillText(tickText(value, pace), X(value), frame.y1 + 5);
    }
    pen.textAlign = "right";
    pen.fillText("time (s)", frame.x1, frame.y1 + 5);
    pen.save();
    pen.beginPath(); pen.rect(frame.x0, frame.y0 - 2, frame.x1 - frame.x0, frame.y1 - frame.y0 + 4); pen.clip();
    if (this.drag && this.drag.to !== undefined) {
      pen.fillStyle = "rgba(0, 114, 178, 0.12)";
      pen.fillRect(X(this.drag.from), frame.y0, X(this.drag.to) - X(this.drag.from), frame.y1 - frame.y0);
    }
    lines.forEach((line, c) => {
      pen.strokeStyle = LINES[c % LINES.length];
      pen.lineWidth = 1.6;
      pen.lineJoin = "round";
      pen.beginPath();
      let down = false;
      for (let k = Math.max(first - 1, 0); k <= last; k += 1) {
        if (line[k] === null) { down = false; continue; }
        if (down) pen.lineTo(X(data.times[k]), Y(line[k])); else pen.moveTo(X(data.times[k]), Y(line[k]));
        down = true;
      }
      pen.stroke();
    });
    pen.strokeStyle = "#b22222";
    pen.lineWidth = 1;
    pen.beginPath(); pen.moveTo(X(state.now), frame.y0); pen.lineTo(X(state.now), frame.y1); pen.stroke();
    pen.restore();
    this.title(pen, frame, exponent, X, Y, narrow);
  }
  title(pen, frame, exponent, X, Y, narrow) {
    const { output, order, lines } = this, at = this.hover === null ? state.now : this.hover;
    const [a, b, share] = between(data.times, at), nearest = share < 0.5 ? a : b;
    pen.textBaseline = "alphabetic";
    pen.textAlign = "left";
    pen.font = "600 12px system-ui, sans-serif";
    pen.fillStyle = "#1b1f24";
    const title = output.name + "  " + output.words[order] + "  (" + unitText(output.units[order], exponent) + ")";
    pen.fillText(title, frame.x0, 14);
    pen.font = "12px system-ui, sans-serif";
    pen.textAlign = "right";
    let place = frame.x1;
    const power = exponent ? " \u00B7 10" + raised(exponent) : "", digits = narrow ? 4 : 6;
    const texts = lines.map((line, c) => (output.components[c] ? output.components[c] + " " : "") + (line[nearest] === null
      ? "-" : shown(line[nearest] / 10 ** exponent, digits) + power)); // as the axis counts
    texts.push("t " + shown(data.times[nearest], digits) + " s");
    for (let c = texts.length - 1; c >= 0; c -= 1) {
      pen.fillStyle = c < lines.length ? LINES[c % LINES.length] : "#5b6570";
      pen.fillText(texts[c], place, narrow ? 30 : 14);
      place -= pen.measureText(texts[c]).width + 12;
    }
    if (this.hover === null) return;
    lines.forEach((line, c) => {
      if (line[nearest] === null) return;
      pen.fillStyle = LINES[c % LINES.length];
      pen.beginPath(); pen.arc(X(data.times[nearest]), Y(line[nearest]), 3.2, 0, 2 * Math.PI); pen.fill();
    });
  }
}
function zoom(from, to) {
  const least = (data.stop - data.start) * 1e-6;
  if (to - from < least) return;
  state.from = from;
  state.to = to;
  for (const panel of panels) panel.draw();
}
function checkbox(parent, text, checked, change) {
  const label = element("label"), box = element("input");
  box.type = "checkbox";
  box.checked = checked;
  box.addEventListener("change", change);
  label.append(box, " " + text);
  parent.append(label);
  return box;
}
const most = data.outputs.reduce((a, output) => Math.max(a, output.words.length), 0);
const outputBoxes = data.outputs.map((output, k) => checkbox(byId("outputs"), output.name, k < 2, arrange));
const orderBoxes = Array.from({ length: most }, (_, k) => checkbox(byId("orders"), data.levels[k], k < 5, arrange));
function arrange() {
  panels.length = 0;
  byId("panels").replaceChildren();
  data.outputs.forEach((output, i) => output.values.forEach((_, order) => {
    if (!outputBoxes[i].checked || !orderBoxes[order].checked) return;
    const panel = new Panel(output, order);
    panels.push(panel);
    byId("panels").append(panel.box);
  }));
  if (!panels.length) byId("panels").append(element("p", data.outputs.length ? "Choose outputs and derivatives." :
    "The mechanism has no outputs."));
  for (const panel of panels) panel.draw();
}
listeners.push(() => { for (const panel of panels) panel.draw(); });

/* Tables. */
function fill(id, headings, rows, numbers) {
  const table = byId(id), head = element("tr");
  headings.forEach((text, k) => head.append(element("th", text, numbers.includes(k) ? "number" : "")));
  const thead = element("thead"), body = element("tbody");
  thead.append(head);
  for (const row of rows) {
    const line = element("tr");
    row.forEach((cell, k) => {
      const text = typeof cell === "number" || cell === null ? shown(cell) : cell;
      const made = element("td", text.text === undefined ? text : text.text, numbers.includes(k) ? "number" : "");
      if (text.largest) made.classList.add("largest");
      if (text.color) { const mark = element("span", undefined, "swatch"); mark.style.background = text.color; made.prepend(mark); }
      line.append(made);
    });
    body.append(line);
  }
  if (!rows.length) { const line = element("tr"), cell = element("td", "none"); cell.colSpan = headings.length; line.append(cell); body.append(line); }
  table.replaceChildren(thead, body);
}
byId("title").textContent = data.title;
byId("summary").textContent = data.summary;
byId("made").textContent = data.made;
if (data.messages.length) { byId("status").hidden = false; byId("status").textContent = data.messages.join("\n"); }
fill("peaks", ["output", "derivative", "unit", "minimum", "at t / s", "maximum", "at t / s"], data.peaks.map((peak) => [
  peak.output, peak.derivative, unitText(peak.unit, 0), { text: shown(peak.minimum), largest: peak.largest[0] }, peak.minimum_at,
  { text: shown(peak.maximum), largest: peak.largest[1] }, peak.maximum_at]), [3, 4, 5, 6]);
fill("parameters", ["name", "value", "unit", "as written"], data.parameters.map(([name, value, unit, written]) =>
  [name, value, unitText(unit, 0), written]), [1]);
fill("bodies", ["name", "mass, kg", "starting position, m"], data.bodies.map((body) => [
  { text: body.name, color: body.color }, body.mass, body.position]), [1]);
fill("elements", ["name", "kind", "bodies"], data.elements, []);
function layOut() { sketchHeight(); drawSketch(); for (const panel of panels) panel.draw(); }
window.addEventListener("resize", layOut);
sketchHeight();
choosePaths();
arrange();
setTime(data.start);
document.documentElement.dataset.ready = "true";
