"use strict";
for (const figure of document.querySelectorAll("figure.scene")) {
  const data = JSON.parse(figure.querySelector("script").textContent);
  const canvas = figure.querySelector("canvas"), pen = canvas.getContext("2d");
  const button = figure.querySelector("button"), seek = figure.querySelector("input");
  const clock = figure.querySelector("output"), list = figure.querySelector(".values");
  const cells = data.values.map(([name]) => {
    const item = document.createElement("span"), cell = document.createElement("b");
    item.append(name + " ", cell);
    list.append(item);
    return cell;
  });
  const helps = k => data.names[k].startsWith(".");
  const known = p => p && p[0] !== null && p[1] !== null && p[2] !== null;
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  for (const way of [...data.points, ...data.shadow]) for (const p of way) if (known(p))
    for (let k = 0; k < 3; k++) { low[k] = Math.min(low[k], p[k]); high[k] = Math.max(high[k], p[k]); }
  const middle = low.map((v, k) => (v + high[k]) / 2);
  const size = Math.max(1e-3, Math.hypot(...low.map((v, k) => high[k] - v)));
  const step = 10 ** Math.floor(Math.log10(size / 2)), floor = low[2];
  let yaw = -0.7, pitch = 0.45, zoom = 1, frame = 0, playing = false, started = 0, held = null;
  seek.max = data.t.length - 1;

  const project = p => {
    const x = p[0] - middle[0], y = p[1] - middle[1], z = p[2] - middle[2];
    const a = Math.cos(yaw) * x - Math.sin(yaw) * y, b = Math.sin(yaw) * x + Math.cos(yaw) * y;
    const scale = zoom * 0.9 * Math.min(canvas.clientWidth, canvas.clientHeight) / size;
    return [canvas.clientWidth / 2 + scale * a,
            canvas.clientHeight / 2 - scale * (Math.cos(pitch) * z + Math.sin(pitch) * b)];
  };
  const path = points => {
    pen.beginPath();
    let on = false;
    for (const p of points) {
      if (!known(p)) { on = false; continue; }
      const [x, y] = project(p);
      on ? pen.lineTo(x, y) : pen.moveTo(x, y);
      on = true;
    }
    pen.stroke();
  };
  const body = (points, colour, width) => {
    pen.strokeStyle = pen.fillStyle = colour;
    for (const [a, b] of data.lines) {
      pen.lineWidth = helps(a) ? 1 : width;
      path([points[a][frame], points[b][frame]]);
    }
    points.forEach((way, k) => {
      if (helps(k) || !known(way[frame])) return;
      pen.beginPath();
      pen.arc(...project(way[frame]), width * 0.9 + 1, 0, 7);
      pen.fill();
    });
  };
  const draw = () => {
    const ratio = devicePixelRatio || 1, style = getComputedStyle(figure);
    const colour = name => style.getPropertyValue("--" + name).trim();
    canvas.width = canvas.clientWidth * ratio;
    canvas.height = canvas.clientHeight * ratio;
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.lineCap = pen.lineJoin = "round";
    pen.strokeStyle = colour("grid");
    pen.lineWidth = 1;
    const edge = k => [Math.floor(low[k] / step - 0.5) * step, Math.ceil(high[k] / step + 0.5) * step];
    const [x0, x1] = edge(0), [y0, y1] = edge(1);
    for (let x = x0; x <= x1 + step / 2; x += step) path([[x, y0, floor], [x, y1, floor]]);
    for (let y = y0; y <= y1 + step / 2; y += step) path([[x0, y, floor], [x1, y, floor]]);
    pen.font = "12px system-ui, sans-serif";
    [["x", [step, 0, 0], "red"], ["y", [0, step, 0], "green"], ["z", [0, 0, step], "blue"]].forEach(([name, v, c]) => {
      const foot = [x0, y0, floor], tip = v.map((one, k) => foot[k] + one), at = project(tip);
      pen.strokeStyle = pen.fillStyle = colour(c);
      pen.lineWidth = 2;
      path([foot, tip]);
      pen.fillText(name, at[0] + 4, at[1] + 4);
    });
    if (data.trail >= 0) {
      pen.lineWidth = 1.2;
      pen.strokeStyle = colour("soft");
      path(data.points[data.trail]);
      pen.strokeStyle = colour("red");
      path(data.points[data.trail].slice(0, frame + 1));
    }
    if (data.shadow.length) body(data.shadow, colour("soft"), 4);
    body(data.points, colour("blue"), 4);
    pen.fillStyle = colour("muted");
    const labels = new Map();
    data.names.forEach((name, k) => {
      if (helps(k) || !known(data.points[k][frame])) return;
      const at = project(data.points[k][frame]), key = at.map(Math.round).join();
      labels.set(key, [labels.has(key) ? labels.get(key)[0] + ", " + name : name, at]);
    });
    for (const [name, at] of labels.values()) pen.fillText(name, at[0] + 9, at[1] - 7);
    const wide = step >= 1 ? step + " m" : Math.round(step * 1000) + " mm";
    pen.fillText(data.grid + " " + wide, 10, canvas.clientHeight - 10);
    clock.textContent = data.t[frame].toFixed(2) + " s";
    data.values.forEach(([, values], k) => {
      const value = values[frame];
      cells[k].textContent = value === null ? "–" : value.toFixed(1).replace("-", "−") + data.unit;
    });
  };
  const show = number => { frame = number; seek.value = number; draw(); };
  const run = now => {
    if (!playing) return;
    const t = data.t[0] + (now - started) / 1000;
    let next = frame;
    while (next < data.t.length - 1 && data.t[next + 1] <= t) next++;
    if (next !== frame) show(next);
    if (next === data.t.length - 1) stop(); else requestAnimationFrame(run);
  };
  const stop = () => { playing = false; button.textContent = "▶"; };
  button.addEventListener("click", () => {
    if (playing) { stop(); return; }
    if (frame === data.t.length - 1) frame = 0;
    playing = true;
    button.textContent = "❚❚";
    started = performance.now() - (data.t[frame] - data.t[0]) * 1000;
    requestAnimationFrame(run);
  });
  seek.addEventListener("input", () => { stop(); show(+seek.value); });
  canvas.addEventListener("pointerdown", e => {
    held = [e.clientX, e.clientY];
    canvas.setPointerCapture(e.pointerId);
  });
  canvas.addEventListener("pointerup", () => { held = null; });
  canvas.addEventListener("pointermove", e => {
    if (!held) return;
    yaw += (e.clientX - held[0]) * 0.01;
    pitch = Math.max(-1.57, Math.min(1.57, pitch + (e.clientY - held[1]) * 0.01));
    held = [e.clientX, e.clientY];
    draw();
  });
  canvas.addEventListener("wheel", e => {
    e.preventDefault();
    zoom = Math.max(0.2, Math.min(20, zoom * Math.exp(-e.deltaY * 0.001)));
    draw();
  }, {passive: false});
  canvas.addEventListener("keydown", e => {
    const turn = {ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1]}[e.key];
    if (!turn) return;
    e.preventDefault();
    yaw += turn[0];
    pitch = Math.max(-1.57, Math.min(1.57, pitch + turn[1]));
    draw();
  });
  canvas.addEventListener("dblclick", () => { yaw = -0.7; pitch = 0.45; zoom = 1; draw(); });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  new ResizeObserver(draw).observe(canvas);
}
