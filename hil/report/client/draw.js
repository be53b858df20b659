"use strict";
// Lines, points and intervals on a canvas; X and Y turn values into its px.

// Place of the sample nearest to t among increasing times.
function nearest(x, t) {
  let low = 0, high = x.length - 1;
  while (high - low > 1) { const mid = (low + high) >> 1; if (x[mid] > t) high = mid; else low = mid; }
  return Math.abs(x[low] - t) <= Math.abs(x[high] - t) ? low : high;
}

// Place of the last sample at t or before.
function latest(x, t) {
  const i = nearest(x, t);
  return i > 0 && x[i] > t ? i - 1 : i;
}

// Samples to draw: all of a curve; of a course what is seen from `seen[0]` to `seen[1]`, and one more on both sides.
function part({ x }, seen) {
  if (!seen || !x.length) return [0, x.length];
  return [Math.max(0, latest(x, seen[0]) - 1), Math.min(x.length, latest(x, seen[1]) + 3)];
}

// A line; of many samples in one column of pixels it draws least, greatest and last.
function drawLine(ctx, trace, X, Y, seen) {
  const { x, y, steps } = trace, [begin, end] = part(trace, seen);
  let drawn = false, column = NaN, low = 0, high = 0, last = 0, count = 0;
  const flush = () => {
    if (count > 1) for (const v of [low, high, last]) ctx.lineTo(column + 0.5, v);
    count = 0;
  };
  ctx.beginPath();
  for (let i = begin; i < end; i++) {
    const px = X(x[i]), py = Y(y[i]);
    if (Number.isNaN(py) || Number.isNaN(px)) { flush(); drawn = false; continue; }
    if (drawn && seen && Math.floor(px) === column) {
      low = Math.min(low, py); high = Math.max(high, py); last = py; count++;
      continue;
    }
    flush();
    if (!drawn) ctx.moveTo(px, py);
    else if (steps) ctx.lineTo(px, last);
    if (drawn) ctx.lineTo(px, py);
    drawn = true; column = Math.floor(px); low = high = last = py; count = 1;
  }
  flush();
  ctx.stroke();
}

function drawDots(ctx, trace, X, Y, seen, radius, chosen) {
  const { x, y } = trace, [begin, end] = part(trace, seen);
  ctx.beginPath();
  for (let i = begin; i < end; i++) {
    const px = X(x[i]), py = Y(y[i]);
    if (Number.isNaN(px) || Number.isNaN(py) || !chosen(i)) continue;
    ctx.moveTo(px + radius, py);
    ctx.arc(px, py, radius, 0, 2 * Math.PI);
  }
  ctx.fill();
}

function drawBars(ctx, { x, y, low, high }, X, Y, rows, ratio) {
  const end = 3 * ratio;
  ctx.beginPath();
  for (let i = 0; i < x.length; i++) {
    const [px, py] = [X(x[i]), Y(y[i])], [a, b] = [low[i], high[i]].map(rows ? X : Y);
    if ([px, py, a, b].some(Number.isNaN)) continue;
    const at = rows ? (along, across) => [along, py + across] : (along, across) => [px + across, along];
    for (const [from, to] of [[at(a, 0), at(b, 0)], [at(a, -end), at(a, end)], [at(b, -end), at(b, end)]]) {
      ctx.moveTo(...from);
      ctx.lineTo(...to);
    }
  }
  ctx.stroke();
}

function drawBand(ctx, { x, low, high }, X, Y) {
  ctx.globalAlpha = 0.18;
  const bad = (i) => Number.isNaN(low[i]) || Number.isNaN(high[i]) || Number.isNaN(x[i]);
  for (let begin = 0; begin < x.length; begin++) {
    if (bad(begin)) continue;
    let end = begin;
    while (end < x.length && !bad(end)) end++;
    ctx.beginPath();
    for (let i = begin; i < end; i++) ctx.lineTo(X(x[i]), Y(low[i]));
    for (let i = end - 1; i >= begin; i--) ctx.lineTo(X(x[i]), Y(high[i]));
    ctx.fill();
    begin = end;
  }
  ctx.globalAlpha = 1;
}
