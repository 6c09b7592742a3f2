"""A body that moves, for a page: lines between points in three dimensions, to be turned by hand and played.

It is drawn on a canvas by one constant script, which the page's policy names by its hash: nothing else may run there,
and nothing is fetched.
"""

import json
from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from hashlib import sha256
from html import escape
from typing import Any, Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.reporting.style import said

_FRAMES: Final = 1500
_RATE: Final = 30.0  # frames per second, which look smooth
_DIGITS: Final = 4  # of lengths in m: a tenth of a millimetre


@dataclass(frozen=True, eq=False)
class Scene:
    """A body of points and lines over time.

    Attributes
    ----------
    caption : str
        A noun.
    t : ndarray (N,)
        Times, s.
    points : mapping of str to ndarray (N, 3)
        Places by name, m; z is up. A name that begins with a dot is a helper's: no mark, no label, thin lines.
    lines : sequence of (str, str)
        Points that are joined.
    trail : str
        Point whose way is drawn; none where empty.
    values : mapping of str to ndarray (N,)
        Numbers that are shown beside the time, by name.
    unit : str
        Of these numbers.
    shadow : mapping of str to ndarray (N, 3)
        A second body with the same lines, drawn pale: what the first one is compared with; may have fewer points.
    """

    caption: str
    t: Floats
    points: Mapping[str, Floats]
    lines: Sequence[tuple[str, str]]
    trail: str = ""
    values: Mapping[str, Floats] = field(default_factory=dict)
    unit: str = "°"
    shadow: Mapping[str, Floats] = field(default_factory=dict)


def policy() -> str:
    """What a page's policy must allow: this one script, by its hash."""
    return f"script-src 'sha256-{b64encode(sha256(SCRIPT.encode()).digest()).decode()}'"


def scene_html(scene: Scene, lang: str) -> str:
    """Figure of a scene; the page that holds it needs `SCRIPT`, `STYLE` and `policy`."""
    words = json.dumps(_data(scene, lang), ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    data = words.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")
    play, time = escape(said("play", lang)), escape(said("time", lang))
    return (
        f"<figure class='scene'><figcaption>{escape(said(scene.caption, lang))}</figcaption>"
        f"<script type='application/json'>{data}</script><canvas tabindex='0' aria-label='{time}'></canvas>"
        f"<div class='seek'><button type='button' aria-label='{play}'>▶</button>"
        f"<input type='range' min='0' value='0' step='1' aria-label='{time}'><output></output></div>"
        f"<div class='values'></div><noscript>{said('This figure needs JavaScript.', lang)}</noscript></figure>"
    )


def _data(scene: Scene, lang: str) -> dict[str, Any]:
    rows = _rows(scene.t)
    names = list(scene.points)
    shaded = names if scene.shadow else []
    return {
        "t": _rounded(scene.t[rows], 3),
        "names": [said(name, lang) for name in names],
        "points": [_rounded(scene.points[name][rows], _DIGITS) for name in names],
        "shadow": [_rounded(scene.shadow[name][rows], _DIGITS) if name in scene.shadow else [] for name in shaded],
        "lines": [[names.index(start), names.index(end)] for start, end in scene.lines],
        "trail": names.index(scene.trail) if scene.trail else -1,
        "values": [[said(name, lang), _rounded(values[rows], 1)] for name, values in scene.values.items()],
        "unit": scene.unit,
        "grid": said("grid", lang),
    }


def _rows(t: Floats) -> Any:
    """Rows of the frames: at most so many a second, and so many in all."""
    wanted = int(min(t.size, _FRAMES, 1 + np.ceil((t[-1] - t[0]) * _RATE)))
    return np.unique(np.searchsorted(t, np.linspace(t[0], t[-1], max(wanted, 2))).clip(0, t.size - 1))


def _rounded(values: Floats, digits: int) -> Any:
    """Lists of numbers; None where one is not known."""
    flat = [round(value, digits) if np.isfinite(value) else None for value in values.ravel().tolist()]
    if values.ndim == 1:
        return flat
    width = values.shape[1]
    return [flat[k : k + width] for k in range(0, len(flat), width)]


STYLE: Final = """\
.scene canvas { display: block; width: 100%; height: 26rem; touch-action: none; cursor: grab; margin-top: 0.4rem;
  border: 1px solid var(--grid); border-radius: 3px; }
.scene canvas:active { cursor: grabbing; }
.seek { display: flex; align-items: center; gap: 0.8rem; margin-top: 0.5rem; font-variant-numeric: tabular-nums; }
.seek input { flex: 1; accent-color: var(--blue); min-width: 0; }
.seek button { width: 2.4rem; height: 2rem; border: 1px solid var(--muted); border-radius: 3px; background: var(--band);
  color: var(--ink); font-size: 0.9rem; cursor: pointer; }
.seek output { min-width: 5.5rem; text-align: right; }
.values { display: flex; flex-wrap: wrap; gap: 0.2rem 1.4rem; margin-top: 0.4rem; font-size: 0.85rem;
  color: var(--muted); font-variant-numeric: tabular-nums; }
.values b { display: inline-block; min-width: 4rem; text-align: right; font-weight: 500; color: var(--ink); }
"""

SCRIPT: Final = """\
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
"""
