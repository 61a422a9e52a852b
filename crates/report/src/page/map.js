// The map: drag to move, wheel with Ctrl or buttons to zoom, values of the branch under the pointer; flicker.
"use strict";
(() => {
  const svg = document.getElementById("map-svg");
  const block = document.getElementById("map-data");
  if (!svg || !block) return;
  const data = JSON.parse(block.textContent);
  const valuesOf = new Map(data.rows.map((row) => [row[0], row]));
  const isTip = (branch) => valuesOf.has(branch) && valuesOf.get(branch)[8] === 1;
  const piecesOf = new Map();
  // The map and the tree in space: a branch is lit in both.
  const space = document.getElementById("space-svg");
  const pictures = space ? [svg, space] : [svg];
  for (const piece of pictures.flatMap((picture) => [...picture.querySelectorAll("[data-b]")])) {
    const branch = Number(piece.dataset.b);
    if (!piecesOf.has(branch)) piecesOf.set(branch, []);
    piecesOf.get(branch).push(piece);
  }

  // Pan and zoom move the view box; the whole is where it began.
  const whole = svg.viewBox.baseVal;
  const start = [whole.x, whole.y, whole.width, whole.height];
  let view = start.slice();
  const show = () => svg.setAttribute("viewBox", view.join(" "));
  const pointAt = (event) => {
    const matrix = svg.getScreenCTM().inverse();
    return new DOMPoint(event.clientX, event.clientY).matrixTransform(matrix);
  };
  function zoom(factor, center) {
    const size = Math.min(Math.max(view[2] * factor, start[2] / 60), start[2] * 1.5);
    const ratio = size / view[2];
    view = [
      center.x - (center.x - view[0]) * ratio,
      center.y - (center.y - view[1]) * ratio,
      size,
      view[3] * ratio,
    ];
    show();
  }
  const middle = () => ({ x: view[0] + view[2] / 2, y: view[1] + view[3] / 2 });
  svg.addEventListener("wheel", (event) => {
    if (!event.ctrlKey && !event.metaKey) return;
    event.preventDefault();
    zoom(Math.exp(0.0022 * event.deltaY), pointAt(event));
  }, { passive: false });

  let drag = null;
  svg.addEventListener("pointerdown", (event) => {
    if (event.button === 0) drag = { x: event.clientX, y: event.clientY, view: view.slice(), moved: false };
  });
  window.addEventListener("pointermove", (event) => {
    if (!drag) return;
    const [dx, dy] = [event.clientX - drag.x, event.clientY - drag.y];
    if (!drag.moved && Math.hypot(dx, dy) < 4) return;
    drag.moved = true;
    hide();
    const scale = svg.getScreenCTM().a;
    view = [drag.view[0] - dx / scale, drag.view[1] - dy / scale, drag.view[2], drag.view[3]];
    show();
  });
  window.addEventListener("pointerup", (event) => {
    const wasClick = drag && !drag.moved;
    drag = null;
    const branch = branchOf(event);
    if (wasClick && branch !== null) choose(branch);
  });

  const tools = document.createElement("div");
  tools.className = "tools";
  for (const [text, name, act] of [
    ["+", "zoom in", () => zoom(0.7, middle())],
    ["−", "zoom out", () => zoom(1 / 0.7, middle())],
    ["all", "show all", () => { view = start.slice(); show(); }],
  ]) {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = text;
    button.setAttribute("aria-label", name);
    button.addEventListener("click", act);
    tools.append(button);
  }
  svg.parentElement.append(tools);

  // A mark of the table of worst nodes: the map goes there.
  for (const link of document.querySelectorAll('a[href^="#at-"]')) {
    link.addEventListener("click", () => {
      const mark = document.getElementById(link.getAttribute("href").slice(1));
      if (!mark) return;
      document.getElementById("show-worst").checked = true;
      const size = start[2] / 5;
      const [x, y] = [Number(mark.getAttribute("cx")), Number(mark.getAttribute("cy"))];
      view = [x - size / 2, y - (size * start[3]) / start[2] / 2, size, (size * start[3]) / start[2]];
      show();
    });
  }

  // The values of the branch under the pointer.
  const tip = document.createElement("div");
  tip.id = "tip";
  document.body.append(tip);
  let lit = null;
  const branchOf = (event) => {
    const piece = event.target instanceof Element ? event.target.closest("[data-b]") : null;
    return piece && pictures.some((picture) => picture.contains(piece)) ? Number(piece.dataset.b) : null;
  };
  function light(branch) {
    if (branch === lit) return;
    for (const [which, isOn] of [[lit, false], [branch, true]]) {
      for (const piece of piecesOf.get(which) || []) piece.classList.toggle("hit", isOn);
    }
    lit = branch;
  }
  function hide() {
    tip.style.display = "none";
    light(null);
  }
  function tell(branch, event) {
    const values = valuesOf.get(branch);
    if (!values) return hide();
    light(branch);
    tip.replaceChildren();
    const title = document.createElement("b");
    title.textContent = `branch ${branch}` + (isTip(branch) ? ", ends in a tip" : "");
    tip.append(title);
    values.forEach((value, index) => {
      if (index === 0 || !data.names[index] || value === null || value === "") return;
      const line = document.createElement("div");
      line.textContent = `${data.names[index]}: ${value}`;
      tip.append(line);
    });
    tip.style.display = "block";
    const [width, height] = [tip.offsetWidth, tip.offsetHeight];
    tip.style.left = `${Math.max(4, Math.min(event.clientX + 14, innerWidth - width - 8))}px`;
    const below = event.clientY + 16;
    tip.style.top = `${below + height > innerHeight ? Math.max(4, event.clientY - height - 12) : below}px`;
  }
  for (const picture of pictures) {
    picture.addEventListener("pointermove", (event) => {
      if (drag && drag.moved) return;
      const branch = branchOf(event);
      if (branch === null) hide();
      else tell(branch, event);
    });
    picture.addEventListener("pointerleave", hide);
  }

  function choose(branch) {
    if (isTip(branch)) document.dispatchEvent(new CustomEvent("tip-chosen", { detail: branch }));
  }

  // Flicker: this run's layout and the one that was looked at last, in turn.
  const layouts = document.querySelector(".layouts");
  if (!layouts) return;
  const inputs = [...layouts.querySelectorAll("input")];
  if (inputs.length < 2) return;
  let other = inputs[1];
  for (const input of inputs.slice(1)) {
    input.addEventListener("change", () => { other = input; });
  }
  let timer = null;
  const button = document.createElement("button");
  button.type = "button";
  button.textContent = "flicker";
  button.addEventListener("click", () => {
    if (timer !== null) {
      clearInterval(timer);
      timer = null;
    } else {
      timer = setInterval(() => { (inputs[0].checked ? other : inputs[0]).checked = true; }, 800);
    }
    button.textContent = timer === null ? "flicker" : "stop";
  });
  layouts.insertBefore(button, layouts.querySelector(".stack"));
})();
