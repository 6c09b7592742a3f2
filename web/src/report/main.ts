// The script of a report: it draws what the page holds, offline, and asks nothing of anybody.

import "uplot/dist/uPlot.min.css";
import "./report.css";
import { Group } from "./charts";
import type { Page } from "./data";

const PAPER = 660; // width of a plot on paper, px

function start(): void {
  const page = JSON.parse(document.getElementById("report-data")?.textContent ?? "null") as Page | null;
  if (!page) return;
  const groups = page.subjects.map((subject, k) => new Group(subject, page.words, `recording-${k}`));
  const waiting: (() => void)[] = [];
  document.querySelectorAll<HTMLElement>("figure[data-chart]").forEach((figure) => {
    const [subject, number] = (figure.dataset.chart ?? "0.0").split(".").map(Number);
    const group = groups[subject ?? 0];
    const chart = group?.subject.charts[number ?? 0];
    if (group && chart) waiting.push(() => group.add(chart, figure));
  });
  const finish = () => {
    while (waiting.length) waiting.shift()?.();
    document.documentElement.dataset.drawn = performance.now().toFixed(0);
  };
  const some = () => {
    const until = performance.now() + 30;
    while (waiting.length && performance.now() < until) waiting.shift()?.();
    if (waiting.length) setTimeout(some);
    else finish();
  };
  some();
  const redraw = () => groups.forEach((group) => group.redraw());
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  addEventListener("beforeprint", () => {
    document.documentElement.dataset.paper = "";
    document.querySelectorAll("details").forEach((one) => (one.open = true));
    finish();
    groups.forEach((group) => group.resize(PAPER));
    redraw();
  });
  addEventListener("afterprint", () => {
    delete document.documentElement.dataset.paper;
    groups.forEach((group) => group.resize());
    redraw();
  });
  document.querySelectorAll<HTMLButtonElement>("button[data-reset]").forEach((button) => {
    button.addEventListener("click", () => groups[Number(button.dataset.reset)]?.reset());
  });
}

start();
