// The calibre on the way from the root to a chosen tip: from the list, or by a click on the map.
"use strict";
(() => {
  const svg = document.getElementById("profile-svg");
  const block = document.getElementById("profile-data");
  const select = document.getElementById("profile-select");
  if (!svg || !block || !select) return;
  const data = JSON.parse(block.textContent);
  const xmlns = svg.namespaceURI;
  // As the plot was made: see plots.rs.
  const [width, height, left, right, top, bottom] = [460, 250, 58, 10, 12, 40];

  const make = (name, attributes, text) => {
    const element = document.createElementNS(xmlns, name);
    for (const key of Object.keys(attributes)) element.setAttribute(key, attributes[key]);
    if (text !== undefined) element.textContent = text;
    return element;
  };

  function wayTo(branch) {
    const branches = [];
    for (let next = branch; next !== null; next = data.branches[next][0]) branches.unshift(next);
    const points = [];
    const forks = [];
    for (const each of branches) {
      const numbers = data.branches[each][1];
      for (let i = 0; i < numbers.length; i += 2) points.push([numbers[i] / 1000, numbers[i + 1] / 1000]);
      forks.push(points[points.length - 1]);
    }
    forks.pop();
    return { points, forks };
  }

  function stepFor(range, wanted) {
    const rough = range / wanted;
    const power = 10 ** Math.floor(Math.log10(rough));
    return [1, 2, 5, 10].map((factor) => factor * power).find((step) => step >= rough * 0.999);
  }

  function draw(branch) {
    if (!data.branches[branch]) return;
    const { points, forks } = wayTo(branch);
    const lastX = points[points.length - 1][0] || 1;
    const lastY = 1.08 * Math.max(...points.map((point) => point[1])) || 1;
    const x = (value) => left + (value / lastX) * (width - left - right);
    const y = (value) => height - bottom - (value / lastY) * (height - top - bottom);
    const names = [...svg.querySelectorAll(".axes text")].slice(-2);
    const axes = make("g", { class: "axes" });
    for (let tick = 0, step = stepFor(lastY, 5); tick <= lastY; tick += step) {
      axes.append(make("line", { class: "grid", x1: left, x2: width - right, y1: y(tick), y2: y(tick) }));
      axes.append(make("text", { x: left - 6, y: y(tick), dy: 4, "text-anchor": "end" }, Number(tick.toPrecision(3))));
    }
    for (let tick = 0, step = stepFor(lastX, 8); tick <= lastX; tick += step) {
      axes.append(make("text", { x: x(tick), y: height - bottom + 16, "text-anchor": "middle" }, Number(tick.toPrecision(3))));
    }
    axes.append(make("path", { d: `M${left} ${top}V${height - bottom}H${width - right}` }), ...names);
    const rings = make("g", { class: "forks" });
    for (const fork of forks) rings.append(make("circle", { cx: x(fork[0]), cy: y(fork[1]), r: 3.4 }));
    const way = points.map((point) => `${x(point[0]).toFixed(1)} ${y(point[1]).toFixed(1)}`);
    svg.replaceChildren(axes, rings, make("path", { class: "way", d: `M${way.join("L")}` }));
    const option = [...select.options].find((each) => each.value === String(branch));
    const said = option ? option.textContent : `branch ${branch}, ${Number(lastX.toPrecision(3))} ${data.unit} from the root`;
    document.getElementById("profile-tip").textContent = `the tip of ${said}`;
    if (option) option.selected = true;
  }

  select.addEventListener("change", () => draw(Number(select.value)));
  document.addEventListener("tip-chosen", (event) => draw(event.detail));
})();
