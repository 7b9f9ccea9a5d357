// Draws the charts of a report. uPlot gives scales, axes, the cursor and what is dragged out; the shapes come from the
// page's own JSON (charts.py makes it) and are painted by hand, since a figure mixes lines, bars and maps.

const dark = matchMedia("(prefers-color-scheme: dark)");
const styles = () => getComputedStyle(document.documentElement);
const ink = () => styles().getPropertyValue("--ink").trim();
const faint = () => styles().getPropertyValue("--line").trim();

/** Lightens a colour that was chosen for white paper where the page is dark. */
function shade(colour) {
  if (!colour || !dark.matches) return colour;
  const [r, g, b] = [1, 3, 5].map((k) => parseInt(colour.slice(k, k + 2), 16));
  const light = (0.3 * r + 0.59 * g + 0.11 * b) / 255;
  if (Math.max(r, g, b) - Math.min(r, g, b) < 24) {
    // Grey: what was dark on white is as light on black.
    const grey = Math.round(255 - 0.82 * (light * 255));
    return `rgb(${grey} ${grey} ${grey} / ${alpha(colour)})`;
  }
  const lift = light < 0.5 ? 0.32 : 0.08;
  return `rgb(${[r, g, b].map((c) => Math.round(c + (255 - c) * lift)).join(" ")} / ${alpha(colour)})`;
}
const alpha = (colour) => (colour.length > 7 ? parseInt(colour.slice(7, 9), 16) / 255 : 1);

const short = (v) => (v === null ? "–" : Math.abs(v) >= 1e5 || (v !== 0 && Math.abs(v) < 1e-3) ? v.toExponential(2) : String(+v.toPrecision(5)));
const words = (n) => document.createTextNode(n);

function element(kind, name, parent) {
  const made = document.createElement(kind);
  if (name) made.className = name;
  if (parent) parent.append(made);
  return made;
}

/** One scale as uPlot takes it; `view` is the stretch that is shown. */
function scaleOf(axis, view) {
  const scale = { time: false, auto: true, range: () => [view.min, view.max], dir: axis.reversed ? -1 : 1 };
  if (axis.scale === "log") return { ...scale, distr: 3, log: 10 };
  if (axis.scale === "asinh") return { ...scale, distr: 4, asinh: axis.around };
  if (axis.scale === "root") return { ...scale, distr: 100, fwd: (v) => Math.sqrt(Math.max(v, 0)), bwd: (v) => v * v };
  return scale;
}

const measure = document.createElement("canvas").getContext("2d");
const FONT = "12px system-ui, sans-serif";

function fitted(text, most) {
  measure.font = FONT;
  if (measure.measureText(text).width <= most) return text;
  let cut = text;
  while (cut.length > 1 && measure.measureText(`${cut}…`).width > most) cut = cut.slice(0, -1);
  return `${cut.trimEnd()}…`;
}

/** Puts a name that is too long on two lines. */
function folded(text, most) {
  if (fitted(text, most) === text) return text;
  const parts = text.split(" ");
  let first = parts.shift();
  while (parts.length && fitted(`${first} ${parts[0]}`, most) === `${first} ${parts[0]}`) first += ` ${parts.shift()}`;
  return parts.length ? `${fitted(first, most)}\n${fitted(parts.join(" "), most)}` : fitted(first, most);
}

/** The numbers from 1 to 9 of each decade between two ends; even steps where these are too few. */
function logSplits(min, max) {
  const found = [];
  for (let e = Math.floor(Math.log10(min)); e <= Math.log10(max); e++) {
    for (let m = 1; m < 10; m++) {
      const v = Number(`${m}e${e}`);
      if (v >= min && v <= max) found.push(v);
    }
  }
  if (found.length > 2) return found;
  const least = (max - min) / 4;
  const power = 10 ** Math.floor(Math.log10(least));
  const step = power * [1, 2, 5, 10].find((s) => s * power >= least);
  const first = Math.ceil(min / step);
  return Array.from({ length: Math.floor(max / step) - first + 1 }, (_, k) => +((first + k) * step).toPrecision(12));
}

function axisOf(axis, upright, width) {
  const marks = {
    label: axis.label || undefined,
    labelSize: axis.label ? 20 : 0,
    labelFont: FONT,
    font: FONT,
    stroke: ink,
    grid: { stroke: faint, width: 1 },
    ticks: { stroke: faint, width: 1, size: 5 },
    gap: 4,
  };
  if (axis.names) {
    const most = upright ? Math.max(60, 0.36 * width) : width / Math.max(1, axis.names.length) - 4;
    const lean = !upright && axis.names.some(([, name]) => fitted(name, most) !== name);
    const names = new Map(axis.names.map(([at, name]) => [at, upright ? folded(name, most) : fitted(name, lean ? 110 : 200)]));
    measure.font = FONT;
    const widest = Math.max(0, ...[...names.values()].flatMap((name) => name.split("\n")).map((name) => measure.measureText(name).width));
    marks.splits = (u, k, min, max) => axis.names.map(([at]) => at).filter((at) => at >= min && at <= max);
    // Of names that would overlap the first is shown.
    marks.values = (u, splits) => {
      let last = null;
      return splits.map((at) => {
        const name = names.get(at) ?? "";
        if (upright || lean) return name;
        const [place, half] = [u.valToPos(at, "x"), measure.measureText(name).width / 2];
        if (last && Math.abs(place - last.place) < half + last.half + 3) return "";
        last = { place, half };
        return name;
      });
    };
    marks.filter = (u, splits) => splits;
    marks.size = upright ? widest + 14 : lean ? widest * 0.75 + 16 : 24;
    if (lean) marks.rotate = -45;
  }
  if (axis.scale === "log" && !axis.names) {
    // uPlot's own would begin at the scale's end, whatever number that is.
    marks.splits = (u, k, min, max) => logSplits(min, max);
    // Few decades: as many numbers as fit; many: the powers alone; within one step: all.
    marks.filter = (u, splits) => {
      const scale = u.scales[upright ? "y" : "x"];
      const wide = scale.max / scale.min;
      const first = wide < 12 ? "123456789" : wide < 1000 ? "125" : "1";
      const round = splits.map((v) => (/^\d(e|$)/.test(v.toExponential()) && first.includes(v.toExponential()[0]) ? v : null));
      return round.filter((v) => v !== null).length > 1 ? round : splits;
    };
  }
  if (axis.names) return marks;
  const large = axis.scale === "log" ? 1e4 : 1e5;
  marks.values = (u, splits) => splits.map((v) => (v === null ? "" : Math.abs(v) >= large || (v !== 0 && Math.abs(v) < 1e-4) ? v.toExponential().replace("e+", "e") : String(+v.toPrecision(9))));
  if (upright) {
    marks.size = (u, values) => {
      measure.font = FONT;
      return 14 + Math.max(34, ...(values ?? []).map((v) => measure.measureText(v ?? "").width));
    };
  } else {
    marks.size = 26;
    marks.space = Math.min(56, width / 4);
  }
  return marks;
}

/** Paints what stands in one pair of axes. */
function paint(u, spec, images) {
  const c = u.ctx;
  const ratio = devicePixelRatio;
  const x = (v) => u.valToPos(v, "x", true);
  const y = (v) => u.valToPos(v, "y", true);
  const { left, top, width, height } = u.bbox;
  c.save();
  c.beginPath();
  c.rect(left, top, width, height);
  c.clip();
  for (const image of images) {
    const [x0, x1, y0, y1] = [x(image.x0), x(image.x1), y(image.y0), y(image.y1)];
    c.imageSmoothingEnabled = false;
    c.save();
    // The first row of the picture lies at y0, its last at y1.
    c.translate(x0, y0);
    c.scale((x1 - x0) / image.columns, (y1 - y0) / image.rows);
    c.drawImage(image.loaded, 0, 0, image.columns, image.rows);
    c.restore();
  }
  for (const band of spec.bands ?? []) {
    c.fillStyle = shade(band.color);
    if (band.axis === "x") c.fillRect(x(band.start), top, x(band.stop) - x(band.start), height);
    else c.fillRect(left, y(band.stop), width, y(band.start) - y(band.stop));
  }
  for (const area of spec.areas ?? []) {
    c.fillStyle = shade(area.color);
    c.beginPath();
    area.x.forEach((v, k) => v !== null && area.y[k] !== null && c.lineTo(x(v), y(area.y[k])));
    c.fill();
  }
  const floor = spec.y.scale === "log" ? spec.y.min : -Infinity;
  const wall = spec.x.scale === "log" ? spec.x.min : -Infinity;
  for (const bar of spec.bars ?? []) {
    c.fillStyle = shade(bar.color);
    const [x0, x1] = [x(Math.max(bar.x0, wall)), x(bar.x1)];
    const [y0, y1] = [y(Math.max(bar.y0, floor)), y(bar.y1)];
    c.fillRect(Math.min(x0, x1), Math.min(y0, y1), Math.max(Math.abs(x1 - x0), ratio), Math.abs(y1 - y0));
  }
  for (const mark of spec.marks ?? []) {
    c.strokeStyle = shade(mark.color);
    c.lineWidth = Math.max(mark.width, 0.7) * ratio;
    c.setLineDash((mark.dash ?? []).map((d) => d * ratio));
    c.beginPath();
    if (mark.axis === "x") { c.moveTo(x(mark.at), top); c.lineTo(x(mark.at), top + height); }
    else { c.moveTo(left, y(mark.at)); c.lineTo(left + width, y(mark.at)); }
    c.stroke();
  }
  c.setLineDash([]);
  for (const some of spec.segments ?? []) {
    c.strokeStyle = shade(some.color);
    c.lineWidth = Math.max(some.width, 0.7) * ratio;
    c.beginPath();
    for (let k = 0; k + 3 < some.at.length; k += 4) {
      if (some.at.slice(k, k + 4).includes(null)) continue;
      c.moveTo(x(some.at[k]), y(some.at[k + 1]));
      c.lineTo(x(some.at[k + 2]), y(some.at[k + 3]));
    }
    c.stroke();
  }
  for (const line of spec.lines ?? []) {
    if (line.width) {
      c.strokeStyle = shade(line.color);
      c.lineWidth = Math.max(line.width, 1) * ratio;
      c.lineJoin = "round";
      c.setLineDash((line.dash ?? []).map((d) => d * ratio));
      c.beginPath();
      let down = false;
      for (let k = 0; k < line.x.length; k++) {
        if (line.x[k] === null || line.y[k] === null) { down = false; continue; }
        if (down) c.lineTo(x(line.x[k]), y(line.y[k]));
        else c.moveTo(x(line.x[k]), y(line.y[k]));
        down = true;
      }
      c.stroke();
      c.setLineDash([]);
    }
    if (line.size) points(c, line, x, y, ratio);
  }
  c.restore();
  for (const text of spec.texts ?? []) {
    c.save();
    c.fillStyle = shade(text.color) ?? ink();
    c.font = `${12 * ratio}px system-ui, sans-serif`;
    c.textAlign = text.align;
    c.textBaseline = { top: "top", bottom: "bottom", baseline: "alphabetic" }[text.rise] ?? "middle";
    const inside = text.within === "axes";
    const at = [inside ? left + text.x * width : x(text.x), inside ? top + (1 - text.y) * height : y(text.y)];
    // What is zoomed out of sight has no name; the margins are the figure's own.
    const slack = 14 * ratio;
    const seen = inside || (at[0] > left - slack && at[0] < left + width + slack && at[1] > top - slack && at[1] < top + height + slack);
    if (seen) text.text.split("\n").forEach((one, k) => c.fillText(one, at[0], at[1] + 15 * ratio * k));
    c.restore();
  }
}

function points(c, line, x, y, ratio) {
  const r = Math.max(line.size * 0.62, 1.4) * ratio;
  c.fillStyle = shade(line.face ?? line.color);
  c.strokeStyle = shade(line.color);
  c.lineWidth = 1.4 * ratio;
  c.beginPath();
  for (let k = 0; k < line.x.length; k++) {
    if (line.x[k] === null || line.y[k] === null) continue;
    const [a, b] = [x(line.x[k]), y(line.y[k])];
    if (line.marker === "|") { c.moveTo(a, b - r); c.lineTo(a, b + r); }
    else if (line.marker === "_") { c.moveTo(a - r, b); c.lineTo(a + r, b); }
    else if (line.marker === "+") { c.moveTo(a, b - r); c.lineTo(a, b + r); c.moveTo(a - r, b); c.lineTo(a + r, b); }
    else if (line.marker === "x") { c.moveTo(a - r, b - r); c.lineTo(a + r, b + r); c.moveTo(a - r, b + r); c.lineTo(a + r, b - r); }
    else if (line.marker === "s") c.rect(a - r, b - r, 2 * r, 2 * r);
    else if (line.marker === "^") { c.moveTo(a, b - r); c.lineTo(a + r, b + r); c.lineTo(a - r, b + r); c.closePath(); }
    else if (line.marker === "v") { c.moveTo(a, b + r); c.lineTo(a + r, b - r); c.lineTo(a - r, b - r); c.closePath(); }
    else { c.moveTo(a + r, b); c.arc(a, b, r, 0, 2 * Math.PI); }
  }
  if ("|_+x".includes(line.marker)) c.stroke();
  else c.fill();
}

/** Says what lies under the cursor: the nearest point within reach, a bar, a cell of a picture. */
function under(u, spec, left, top) {
  const x = (v) => u.valToPos(v, "x");
  const y = (v) => u.valToPos(v, "y");
  let best = null;
  let reach = 26 * 26;
  const near = (a, b, name) => {
    if (a === null || b === null) return;
    const d = (x(a) - left) ** 2 + (y(b) - top) ** 2;
    if (d < reach) { reach = d; best = { name, x: a, y: b }; }
  };
  for (const line of spec.lines ?? []) line.x.forEach((a, k) => near(a, line.y[k], line.name));
  if (best) return best;
  const [at, up] = [u.posToVal(left, "x"), u.posToVal(top, "y")];
  const within = (a, b, v) => v >= Math.min(a, b) && v <= Math.max(a, b);
  for (const bar of spec.bars ?? []) {
    if (within(bar.x0, bar.x1, at) && within(bar.y0, bar.y1, up)) {
      const flat = spec.y.names !== undefined;
      const value = flat ? bar.x1 - bar.x0 : bar.y1 - bar.y0;
      return { name: bar.name, text: `${short(value)}${flat ? "" : ` at ${short((bar.x0 + bar.x1) / 2)}`}` };
    }
  }
  for (const image of spec.images ?? []) {
    if (!within(image.x0, image.x1, at) || !within(image.y0, image.y1, up)) continue;
    const column = Math.min(image.columns - 1, Math.floor(((at - image.x0) / (image.x1 - image.x0)) * image.columns));
    const row = Math.min(image.rows - 1, Math.floor(((up - image.y0) / (image.y1 - image.y0)) * image.rows));
    const place = image.flip ? image.values.length - (row + 1) * image.columns + column : row * image.columns + column;
    const names = (axis, k) => axis.names?.find(([v]) => Math.round(v) === k)?.[1] ?? String(k);
    const across = names(spec.x, Math.floor(image.x0 + 0.5 + column * Math.sign(image.x1 - image.x0)));
    const down = names(spec.y, Math.floor(Math.min(image.y0, image.y1) + 0.5 + row));
    return { name: "", text: `${spec.x.label || "x"} ${across}, ${spec.y.label || "y"} ${down}: ${short(image.values[place])}` };
  }
  return null;
}

function named(axis, value) {
  const found = axis.names?.find(([at]) => Math.abs(at - value) < 1e-6);
  return found ? found[1] : short(value);
}

/** Builds one chart in its box; gives back what redraws it and what zooms it. */
function build(box, spec, images, group) {
  const view = { x: { min: spec.x.min, max: spec.x.max }, y: { min: spec.y.min, max: spec.y.max } };
  const width = Math.max(120, box.clientWidth);
  const xAxis = axisOf(spec.x, false, width);
  const yAxis = axisOf(spec.y, true, width);
  const rows = 17 * (spec.y.names ?? []).length;
  let height = Math.max(spec.height, rows + 30) + (xAxis.size - 20) + (spec.x.label ? 20 : 0);
  if (spec.equal) {
    const margins = (typeof yAxis.size === "number" ? yAxis.size : 48) + yAxis.labelSize + 16;
    const tall = (spec.y.max - spec.y.min) / (spec.x.max - spec.x.min);
    height = Math.min(620, Math.max(50, (width - margins) * tall)) + xAxis.size + xAxis.labelSize + 12;
  }
  const tip = element("div", "tip");
  const show = (axis, stretch) => { Object.assign(view[axis], stretch); u.setScale(axis, { ...stretch }); };
  const u = new uPlot(
    {
      width,
      height,
      padding: [10, 12, 0, 4],
      legend: { show: false },
      cursor: { points: { show: false }, drag: { x: true, y: true, uni: 24, setScale: false }, bind: { dblclick: () => () => null } },
      scales: { x: scaleOf(spec.x, view.x), y: scaleOf(spec.y, view.y) },
      axes: [xAxis, yAxis],
      series: [{}, { show: true, paths: () => null, points: { show: false } }],
      hooks: {
        draw: [(own) => paint(own, spec, images)],
        setCursor: [(own) => hover(own)],
        setSelect: [
          (own) => {
            const s = own.select;
            if (s.width > 6) group.x(own.posToVal(s.left, "x"), own.posToVal(s.left + s.width, "x"), u);
            if (s.height > 6 && s.height < own.over.clientHeight - 1) {
              const ends = [own.posToVal(s.top, "y"), own.posToVal(s.top + s.height, "y")];
              show("y", { min: Math.min(...ends), max: Math.max(...ends) });
            }
            own.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
          },
        ],
      },
    },
    [[spec.x.min, spec.x.max], [spec.y.min, spec.y.max]],
    box,
  );
  u.over.append(tip);
  function hover(own) {
    const { left, top } = own.cursor;
    const found = left >= 0 && top >= 0 ? under(own, spec, left, top) : null;
    tip.style.display = found ? "block" : "none";
    if (!found) return;
    const name = found.name ? `${found.name}: ` : "";
    const labels = (axis, value) => `${axis.label ? `${axis.label} ` : ""}${named(axis, value)}`;
    tip.textContent = found.text ? name + found.text : `${name}${labels(spec.x, found.x)}, ${labels(spec.y, found.y)}`;
    const flip = left > own.over.clientWidth / 2;
    tip.style.left = flip ? "" : `${left + 12}px`;
    tip.style.right = flip ? `${own.over.clientWidth - left + 12}px` : "";
    tip.style.top = `${Math.min(top + 12, own.over.clientHeight - 30)}px`;
  }
  const home = () => {
    group.x(spec.x.min, spec.x.max, u);
    show("y", { min: spec.y.min, max: spec.y.max });
  };
  u.over.addEventListener("dblclick", home);
  fingers(u, view, show, group, home);
  return { u, show: (min, max) => show("x", { min, max }), home };
}

/** One finger shows the value under it, two zoom along x, a double tap shows all again. */
function fingers(u, view, show, group, home) {
  let before = null;
  let tapped = 0;
  const places = (e) => [...e.touches].map((t) => t.clientX - u.over.getBoundingClientRect().left);
  const point = (e) => {
    const box = u.over.getBoundingClientRect();
    u.setCursor({ left: e.touches[0].clientX - box.left, top: e.touches[0].clientY - box.top });
  };
  u.over.addEventListener("touchstart", (e) => {
    if (e.touches.length === 2) before = places(e).map((at) => u.posToVal(at, "x"));
    else {
      point(e);
      if (e.timeStamp - tapped < 300) home();
      tapped = e.timeStamp;
    }
  }, { passive: true });
  u.over.addEventListener("touchmove", (e) => {
    if (e.touches.length !== 2 || !before) return;
    e.preventDefault();
    const now = places(e);
    const wide = u.over.clientWidth;
    const share = Math.abs(now[1] - now[0]) / wide;
    if (share < 0.02) return;
    // On the scale as it is drawn the two values stay under the two fingers.
    const span = Math.abs(before[1] - before[0]) / share;
    const start = Math.min(...before) - (Math.min(...now) / wide) * span;
    if (Number.isFinite(start)) group.x(Math.max(start, u.scales.x.distr === 3 ? 1e-12 : -Infinity), start + span, u);
  }, { passive: false });
}

function legend(entries, title, parent) {
  if (!entries.length) return;
  const list = element("div", "legend", parent);
  if (title) element("span", "", list).textContent = title;
  for (const entry of entries) {
    const one = element("span", "", list);
    const swatch = element("i", entry.kind, one);
    swatch.style.setProperty("--mark", shade(entry.color) ?? ink());
    one.append(words(entry.name));
  }
}

function scaleStrip(scale, parent) {
  const strip = element("div", "strip", parent);
  strip.append(words(short(scale.min)));
  element("i", "", strip).style.background = `linear-gradient(to right, ${scale.shades.join(", ")})`;
  strip.append(words(`${short(scale.max)} ${scale.label}`));
}

const turns = new WeakMap();

async function draw(holder) {
  const given = JSON.parse(holder.querySelector("script").textContent);
  // Pictures take a while to load; a window that is dragged wider asks for the next drawing before.
  const turn = (turns.get(holder) ?? 0) + 1;
  turns.set(holder, turn);
  for (const old of [...holder.children]) if (old.tagName !== "SCRIPT") old.remove();
  if (given.title) element("p", "title", holder).textContent = given.title;
  const grid = element("div", "grid", holder);
  // As many side by side as the figure has, and as stay legible.
  const least = given.axes.some((spec) => spec.equal) ? 165 : 290;
  const fit = Math.max(1, Math.min(given.columns, Math.floor(grid.clientWidth / least)));
  const whole = fit === given.columns && given.axes.every((spec) => spec.place);
  // Where fewer fit, rows are filled evenly.
  const columns = whole ? fit : Math.ceil(given.axes.length / Math.ceil(given.axes.length / fit));
  grid.style.gridTemplateColumns = `repeat(${columns}, minmax(0, 1fr))`;
  const built = [];
  for (const spec of given.axes) {
    const cell = element("div", "cell", grid);
    if (whole) {
      const [top, bottom, left, right] = spec.place;
      cell.style.gridArea = `${top} / ${left} / ${bottom} / ${right}`;
    }
    if (spec.title) element("p", "title", cell).textContent = spec.title;
    const box = element("div", "plot", cell);
    box.setAttribute("role", "img");
    box.setAttribute("aria-label", [spec.title || given.title, [spec.y.label, spec.x.label].filter(Boolean).join(" by ")].filter(Boolean).join(": "));
    legend(spec.legend, spec.legend_title, cell);
    const images = await Promise.all(
      (spec.images ?? []).map(async (image) => {
        const loaded = new Image();
        loaded.src = `data:image/png;base64,${image.png}`;
        await loaded.decode();
        return { ...image, loaded };
      }),
    );
    if (turns.get(holder) !== turn) return;
    const group = {
      x: (min, max, own) => {
        for (const other of built) {
          if (other.u === own || (spec.group !== null && other.group === spec.group)) other.show(min, max);
        }
      },
    };
    built.push({ ...build(box, spec, images, group), group: spec.group });
  }
  for (const scale of given.scales) scaleStrip(scale, holder);
  holder.dataset.drawn = built.length;
}

const holders = [...document.querySelectorAll(".charts")];
const redraw = () => { for (const holder of holders) draw(holder); };
redraw();
dark.addEventListener("change", redraw);
let wide = innerWidth;
addEventListener("resize", () => { if (innerWidth !== wide) { wide = innerWidth; redraw(); } });
