// Traces on a canvas: an envelope from smallest to largest, the 2-sigma band about it, gaps hatched.

const LEFT = 58;
const RIGHT = 8;

export function colours() {
  const style = getComputedStyle(document.querySelector(".live"));
  const read = (name) => style.getPropertyValue(name).trim();
  return {
    card: read("--card"), ink: read("--ink"), soft: read("--soft"), rule: read("--rule"),
    gap: read("--gap"), bad: read("--bad"), wary: read("--wary"),
    axes: [read("--x"), read("--y"), read("--z")],
  };
}

// Sizes the canvas to its box in device pixels; returns the context, cleared, in CSS pixels.
export function begin(canvas, colour) {
  const ratio = window.devicePixelRatio || 1;
  const width = canvas.clientWidth;
  const height = canvas.clientHeight;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const pen = canvas.getContext("2d", { alpha: false });
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.fillStyle = colour.card;
  pen.fillRect(0, 0, width, height);
  return { pen, width, height };
}

// A range that grows at once and shrinks only after it has been too wide for a while.
export class Range {
  constructor(least) {
    this.least = least;
    this.low = -least;
    this.high = least;
    this.wideSince = 0;
  }

  fit(low, high, now) {
    if (!(low <= high)) return this;
    const pad = 0.08 * Math.max(high - low, this.least);
    const [a, b] = rounded(Math.min(low - pad, 0), Math.max(high + pad, 0), this.least);
    if (a < this.low || b > this.high) {
      this.low = Math.min(a, this.low);
      this.high = Math.max(b, this.high);
      this.wideSince = now;
    } else if (b - a > 0.6 * (this.high - this.low)) {
      this.wideSince = now;
    } else if (now - this.wideSince > 3000) {
      [this.low, this.high, this.wideSince] = [a, b, now];
    }
    return this;
  }
}

function rounded(low, high, least) {
  const step = tick(Math.max(high - low, least), 8);
  return [Math.floor(low / step) * step, Math.ceil(high / step) * step];
}

function tick(span, count) {
  const raw = span / count;
  const power = 10 ** Math.floor(Math.log10(raw));
  for (const k of [1, 2, 2.5, 5]) if (raw <= k * power) return k * power;
  return 10 * power;
}

// Draws one panel. `traces`: [{ index, colour, band, label }], and of a plain line { line, less, dashed }:
// drawn less a number, also where no estimate is valid. `box`: { end, span } of time in s.
export function panel(canvas, groups, traces, range, box, colour, text) {
  const { pen, width, height } = begin(canvas, colour);
  const x = (t) => width - RIGHT - ((box.end - t) / box.span) * (width - LEFT - RIGHT);
  const y = (v) => 6 + ((range.high - v) / (range.high - range.low)) * (height - 12);
  grid(pen, width, height, x, y, range, box, colour);
  gaps(pen, groups, x, 0, height, colour, box);
  pen.save();
  pen.beginPath();
  pen.rect(LEFT, 0, width - LEFT - RIGHT, height);
  pen.clip();
  for (const trace of traces) {
    for (const run of runs(groups, trace.line)) (trace.line ? line : draw)(pen, run, trace, x, y);
  }
  if (text.limit > 0) limits(pen, width, y, text.limit, colour);
  pen.restore();
  titles(pen, traces, text, colour);
  if (text.times) clock(pen, height, x, box, colour);
}

// s before now, along the bottom.
function clock(pen, height, x, box, colour) {
  pen.font = "12px system-ui, sans-serif";
  pen.textAlign = "center";
  pen.textBaseline = "bottom";
  const beat = tick(box.span, 10);
  for (let back = beat; back < box.span; back += beat) {
    const words = `-${Number(back.toPrecision(3))} s`;
    const wide = pen.measureText(words).width;
    pen.globalAlpha = 0.8;
    pen.fillStyle = colour.card;
    pen.fillRect(x(box.end - back) - wide / 2 - 2, height - 16, wide + 4, 16);
    pen.globalAlpha = 1;
    pen.fillStyle = colour.soft;
    pen.fillText(words, x(box.end - back), height - 1);
  }
}

// Stretches that lines may join, each a list of groups; `any`: also those that are not valid.
function* runs(groups, any) {
  let run = [];
  for (const group of groups) {
    if (!(any ? !group.gap : group.joined) && run.length) {
      yield run;
      run = [];
    }
    run.push(group);
  }
  if (run.length) yield run;
}

function line(pen, run, trace, x, y) {
  const k = trace.index;
  pen.strokeStyle = trace.colour;
  pen.lineWidth = 1.4;
  pen.setLineDash(trace.dashed ? [6, 4] : []);
  pen.beginPath();
  let begun = false;
  for (const g of run) {
    const v = (g.low[k] + g.high[k]) / 2 - trace.less;
    if (Number.isNaN(v)) begun = false;
    else if (begun) pen.lineTo(x(g.t), y(v));
    else pen.moveTo(x(g.t), y(v));
    begun ||= !Number.isNaN(v);
  }
  pen.stroke();
  pen.setLineDash([]);
}

function draw(pen, run, trace, x, y) {
  const k = trace.index;
  const known = run.filter((g) => !Number.isNaN(g.low[k]));
  if (!known.length) return;
  pen.fillStyle = pen.strokeStyle = trace.colour;
  if (trace.band) {
    pen.globalAlpha = 0.2;
    area(pen, known, x, (g) => y(g.high[k] + 2 * g.sd[k]), (g) => y(g.low[k] - 2 * g.sd[k]));
  }
  pen.globalAlpha = 0.45;
  area(pen, known, x, (g) => y(g.high[k]), (g) => y(g.low[k]));
  pen.globalAlpha = 1;
  pen.lineWidth = 1.4;
  pen.lineJoin = "round";
  for (const side of ["high", "low"]) {
    pen.beginPath();
    known.forEach((g, i) => (i ? pen.lineTo(x(g.t), y(g[side][k])) : pen.moveTo(x(g.t), y(g[side][k]))));
    if (known.length === 1) pen.lineTo(x(known[0].t) + 1.4, y(known[0][side][k]));
    pen.stroke();
  }
}

function area(pen, run, x, top, bottom) {
  pen.beginPath();
  run.forEach((g, i) => (i ? pen.lineTo(x(g.t), top(g)) : pen.moveTo(x(g.t), top(g))));
  for (let i = run.length - 1; i >= 0; i--) pen.lineTo(x(run[i].t), bottom(run[i]));
  pen.closePath();
  pen.fill();
}

function grid(pen, width, height, x, y, range, box, colour) {
  pen.strokeStyle = colour.rule;
  pen.fillStyle = colour.soft;
  pen.lineWidth = 1;
  pen.font = "12px system-ui, sans-serif";
  pen.textAlign = "right";
  pen.textBaseline = "middle";
  const step = tick(range.high - range.low, Math.max(2, Math.floor(height / 22)));
  for (let v = Math.ceil(range.low / step) * step; v <= range.high + step / 1e6; v += step) {
    const at = Math.round(y(v)) + 0.5;
    pen.globalAlpha = Math.abs(v) < step / 1e6 ? 1 : 0.55;
    pen.beginPath();
    pen.moveTo(LEFT, at);
    pen.lineTo(width - RIGHT, at);
    pen.stroke();
    pen.globalAlpha = 1;
    pen.fillText(String(Number(v.toPrecision(6))), LEFT - 6, Math.min(Math.max(at, 8), height - 8));
  }
  const beat = tick(box.span, 10);
  pen.globalAlpha = 0.55;
  for (let back = 0; back <= box.span; back += beat) {
    const at = Math.round(x(box.end - back)) + 0.5;
    pen.beginPath();
    pen.moveTo(at, 0);
    pen.lineTo(at, height);
    pen.stroke();
  }
  pen.globalAlpha = 1;
}

// Hatches every stretch without a valid sample or without any sample at all.
function gaps(pen, groups, x, top, bottom, colour, box) {
  pen.save();
  pen.strokeStyle = colour.gap;
  pen.lineWidth = 1;
  for (const [from, to] of stretches(groups, box)) {
    const a = Math.max(x(from), LEFT);
    const b = Math.max(x(to), a + 1.5);
    pen.save();
    pen.beginPath();
    pen.rect(a, top, b - a, bottom - top);
    pen.clip();
    pen.globalAlpha = 0.1;
    pen.fillStyle = colour.gap;
    pen.fillRect(a, top, b - a, bottom - top);
    pen.globalAlpha = 0.5;
    pen.beginPath();
    const h = bottom - top;
    for (let s = Math.floor((a - h) / 9) * 9; s < b; s += 9) {
      pen.moveTo(s, bottom);
      pen.lineTo(s + h, top);
    }
    pen.stroke();
    pen.restore();
  }
  pen.restore();
}

// [from, to, doubt, kind]: kind "invalid" from the last sound group to the last bad one, "none"
// where nothing came.
export function* stretches(groups, box) {
  let last = box.end - box.span;
  let open = null;
  for (const g of groups) {
    if (g.gap && g !== groups[0]) {
      if (open) yield open;
      open = null;
      yield [last, g.t, 0, "none"];
    }
    if (g.invalid) {
      if (open && open[2] === g.doubt) open[1] = g.t;
      else {
        if (open) yield open;
        open = [g === groups[0] ? g.t : last, g.t, g.doubt, "invalid"];
      }
    } else if (open) {
      open[1] = g.t;
      yield open;
      open = null;
    }
    last = g.t;
  }
  if (open) yield open;
}

function limits(pen, width, y, limit, colour) {
  pen.strokeStyle = colour.bad;
  pen.lineWidth = 1.5;
  pen.setLineDash([7, 5]);
  for (const v of [limit, -limit]) {
    pen.beginPath();
    pen.moveTo(LEFT, y(v));
    pen.lineTo(width - RIGHT, y(v));
    pen.stroke();
  }
  pen.setLineDash([]);
}

function titles(pen, traces, text, colour) {
  pen.font = "600 13px system-ui, sans-serif";
  pen.textAlign = "left";
  pen.textBaseline = "top";
  let at = LEFT + 8;
  const write = (words, paint) => {
    const wide = pen.measureText(words).width;
    pen.globalAlpha = 0.8;
    pen.fillStyle = colour.card;
    pen.fillRect(at - 3, 3, wide + 6, 18);
    pen.globalAlpha = 1;
    pen.fillStyle = paint;
    pen.fillText(words, at, 5);
    at += wide + 14;
  };
  write(text.title, colour.ink);
  for (const trace of traces) if (trace.label) write(trace.label, trace.colour);
}

// The strip between the plots: why there are gaps, in words where they fit.
export function strip(canvas, groups, box, colour, reason) {
  const { pen, width, height } = begin(canvas, colour);
  const x = (t) => width - RIGHT - ((box.end - t) / box.span) * (width - LEFT - RIGHT);
  pen.font = "600 12px system-ui, sans-serif";
  pen.textBaseline = "middle";
  pen.textAlign = "left";
  let free = LEFT;
  pen.fillStyle = colour.wary;
  for (let i = 1; i < groups.length; i++) {
    const [a, b] = [Math.max(x(groups[i - 1].t), LEFT), x(groups[i].t)];
    if (groups[i].doubt && !groups[i].invalid && !groups[i].gap) pen.fillRect(a, 0, b - a + 0.5, 3);
  }
  const labels = []; // one for stretches that touch, with every reason
  for (const [from, to, doubt, kind] of stretches(groups, box)) {
    const a = Math.max(x(from), LEFT);
    const b = Math.max(x(to), a + 2);
    pen.fillStyle = colour.gap;
    pen.globalAlpha = 0.9;
    pen.fillRect(a, 0, b - a, 5);
    pen.globalAlpha = 1;
    const last = labels[labels.length - 1];
    const label = last && a - last.to < 3 ? last : { from: a, words: new Set() };
    if (label !== last) labels.push(label);
    label.to = b;
    for (const words of reason(doubt, kind)) label.words.add(words);
  }
  for (const label of labels) {
    const words = [...label.words].join(", ");
    const place = Math.max(LEFT, Math.min(label.from, width - RIGHT - pen.measureText(words).width));
    if (place < free) continue;
    pen.fillText(words, place, height / 2 + 4);
    free = place + pen.measureText(words).width + 12;
  }
}
