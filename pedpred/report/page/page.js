// Show the tooltip of what is pointed at, tapped or focused.
const tip = document.getElementById("tip");

function showTip(target) {
  tip.hidden = !target;
  if (!target) return;
  tip.textContent = target.dataset.tip;
  const at = target.getBoundingClientRect(), own = tip.getBoundingClientRect();
  const left = Math.min(Math.max(at.left + at.width / 2 - own.width / 2, 8), document.documentElement.clientWidth - own.width - 8);
  const above = at.top - own.height - 8;
  tip.style.left = `${left}px`;
  tip.style.top = `${above > 4 ? above : at.bottom + 8}px`;
}

for (const kind of ["pointerover", "focusin", "click"]) {
  document.addEventListener(kind, ({ target }) => showTip(target.closest?.("[data-tip]")));
}
document.addEventListener("scroll", () => showTip(null), { passive: true, capture: true });

// Methods can be taken out of the plots.
document.querySelector(".legend")?.addEventListener("change", ({ target }) => {
  for (const group of document.querySelectorAll(`[data-method="${target.value}"]`)) {
    group.toggleAttribute("hidden", !target.checked);
  }
});

const payloads = new Map([...document.querySelectorAll("script.replay")]
  .map((script) => [script.dataset.name, { header: JSON.parse(script.textContent), data: script.nextElementSibling.textContent }]));
const methods = JSON.parse(document.getElementById("methods").textContent);
if (payloads.size) {
  const root = document.getElementById("player");
  root.player = new Player(root, payloads, methods);
  root.player.open(payloads.keys().next().value);
}
