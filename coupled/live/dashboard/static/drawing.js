"use strict";
// Drawing on canvases: axes in the field's units, lines, the artificial horizon, bars.

const colour = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

function sheet(id) {
  const canvas = document.getElementById(id), box = canvas.getBoundingClientRect();
  const scale = window.devicePixelRatio || 1;
  const w = Math.round(box.width * scale), h = Math.round(box.height * scale);
  if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
  const pen = canvas.getContext("2d");
  pen.setTransform(scale, 0, 0, scale, 0, 0);
  pen.clearRect(0, 0, box.width, box.height);
  pen.font = "11px system-ui, sans-serif";
  return { pen, w: box.width, h: box.height };
}

function step(span) {
  const raw = span / 5, ten = 10 ** Math.floor(Math.log10(raw));
  return [1, 2, 5, 10].map(n => n * ten).find(n => n >= raw);
}

// Returns functions from data to pixels, with axes drawn for [x0, x1] by [y0, y1].
function axes({ pen, w, h }, x0, x1, y0, y1, xLabel, yLabel) {
  const left = 46, bottom = 30, top = 16, right = 10;
  const x = v => left + (v - x0) / (x1 - x0) * (w - left - right);
  const y = v => h - bottom - (v - y0) / (y1 - y0) * (h - bottom - top);
  pen.strokeStyle = colour("--line"); pen.fillStyle = colour("--soft"); pen.lineWidth = 1;
  const dx = step(x1 - x0), dy = step(y1 - y0);
  const digits = d => Math.max(0, -Math.floor(Math.log10(d) + 1e-9));
  pen.textAlign = "center";
  for (let v = Math.ceil(x0 / dx) * dx; v <= x1 + 1e-9; v += dx) {
    line(pen, [[x(v), y(y0)], [x(v), y(y1)]]);
    pen.fillText((v + 0).toFixed(digits(dx)).replace(/^-0(\.0*)?$/, "0"), x(v), h - bottom + 13);
  }
  pen.textAlign = "right";
  for (let v = Math.ceil(y0 / dy) * dy; v <= y1 + 1e-9; v += dy) {
    line(pen, [[x(x0), y(v)], [x(x1), y(v)]]);
    pen.fillText((v + 0).toFixed(digits(dy)).replace(/^-0(\.0*)?$/, "0"), left - 5, y(v) + 4);
  }
  pen.textAlign = "right"; pen.fillText(xLabel, w - right, h - 4);
  pen.textAlign = "left"; pen.fillText(yLabel, 4, 11);
  return { x, y };
}

function line(pen, points) {
  pen.beginPath();
  points.forEach(([px, py], i) => i ? pen.lineTo(px, py) : pen.moveTo(px, py));
  pen.stroke();
}

function dot(pen, px, py, fill) {
  pen.fillStyle = fill; pen.beginPath(); pen.arc(px, py, 5, 0, 7); pen.fill();
}

function drawLoop(deflection, force, gradient, breakout, travel, unit) {
  const page = sheet("loop"), { pen } = page;
  const most = Math.max(20, 1.15 * Math.max(...force.map(Math.abs), 0));
  const wide = Math.max(0.25 * travel, 1.15 * Math.max(...deflection.map(Math.abs), 0));
  const { x, y } = axes(page, -wide, wide, -most, most, `deflection δ, ${unit}`, "force F, N");
  pen.strokeStyle = colour("--soft"); pen.setLineDash([5, 4]);
  const end = Math.max(0, Math.min(wide, (most - breakout) / gradient)), high = breakout + end * gradient;
  line(pen, [[x(-end), y(-high)], [x(0), y(-breakout)], [x(0), y(breakout)], [x(end), y(high)]]);
  pen.setLineDash([]); pen.strokeStyle = colour("--one"); pen.lineWidth = 1.6;
  line(pen, deflection.map((d, i) => [x(d), y(force[i])]));
  if (deflection.length) dot(pen, x(deflection.at(-1)), y(force.at(-1)), colour("--one"));
}

function drawSchedule(pressures, gradients, pressure, gradient, unit) {
  const page = sheet("schedule"), { pen } = page;
  const high = 1.15 * Math.max(...gradients, gradient), far = Math.max(...pressures, pressure);
  const { x, y } = axes(page, 0, far / 1000 || 1, 0, high || 1, "q̄, kPa", `G_T, N/${unit}`);
  pen.strokeStyle = colour("--soft"); pen.lineWidth = 1.6;
  line(pen, pressures.map((q, i) => [x(q / 1000), y(gradients[i])]));
  dot(pen, x(pressure / 1000), y(gradient), colour("--one"));
}

function drawAttitude(roll, pitch) {
  const { pen, w, h } = sheet("attitude"), perRadian = h * 1.6;
  pen.save(); pen.beginPath(); pen.rect(0, 0, w, h); pen.clip();
  pen.translate(w / 2, h / 2); pen.rotate(-roll); pen.translate(0, pitch * perRadian);
  pen.fillStyle = "#3b7dc4"; pen.fillRect(-2 * w, -3 * h, 4 * w, 3 * h);
  pen.fillStyle = "#8a6a3b"; pen.fillRect(-2 * w, 0, 4 * w, 3 * h);
  pen.strokeStyle = pen.fillStyle = "#fff"; pen.lineWidth = 1.5; pen.textAlign = "left";
  line(pen, [[-2 * w, 0], [2 * w, 0]]);
  for (let deg = -30; deg <= 30; deg += 10) if (deg) {
    const up = -deg * Math.PI / 180 * perRadian;
    line(pen, [[-28, up], [28, up]]); pen.fillText(`${deg}°`, 33, up + 4);
  }
  pen.restore(); pen.strokeStyle = "#ffd43b"; pen.lineWidth = 3;
  line(pen, [[w / 2 - 48, h / 2], [w / 2 - 14, h / 2], [w / 2, h / 2 + 9], [w / 2 + 14, h / 2], [w / 2 + 48, h / 2]]);
}

function drawLateness(from, counts) {
  const { pen, w, h } = sheet("lateness"), all = counts.reduce((a, b) => a + b, 0) || 1;
  const wide = (w - 8) / counts.length;
  pen.textAlign = "center";
  counts.forEach((n, i) => {
    const tall = n ? Math.max(2, (h - 44) * Math.log10(1 + 9 * n / all)) : 0;
    pen.fillStyle = colour(from[i] >= 1 ? "--bad" : "--one");
    pen.fillRect(4 + i * wide + 2, h - 26 - tall, wide - 4, tall);
    pen.fillStyle = colour("--soft");
    pen.fillText(from[i], 4 + i * wide + wide / 2, h - 13);
  });
  pen.fillText("late by at least, ms", w / 2, h - 1);
}
