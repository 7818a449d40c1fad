"use strict";
// Draws the page's plots, then tells so by the event "plotted".
(async () => {
  const { document: content, places } = JSON.parse(document.getElementById("plots").textContent);
  await Bokeh.embed.embed_items({ page: content }, [{ docid: "page", roots: places, root_ids: Object.keys(places) }]);
  const plotted = Bokeh.documents.at(-1);

  // A finger that swipes over a plot scrolls the page, until a tool is chosen by its button.
  if (matchMedia("(pointer: coarse), (max-width: 50rem)").matches) {
    for (const model of plotted._all_models.values()) {
      if (model.type === "Toolbar") model.setv({ active_drag: null, active_scroll: null });
    }
  }

  // A checkbox with data-layer="x" shows and hides everything that is tagged "layer:x".
  for (const box of document.querySelectorAll("input[data-layer]")) {
    const tag = `layer:${box.dataset.layer}`;
    const layer = [...plotted._all_models.values()].filter((model) => model.tags.includes(tag) && "visible" in model.properties);
    const show = () => layer.forEach((model) => { model.visible = box.checked; });
    box.addEventListener("change", show);
    show();
  }
  // What is folded is printed too.
  const folded = [...document.querySelectorAll("details:not([open])")];
  addEventListener("beforeprint", () => folded.forEach((each) => { each.open = true; }));

  document.documentElement.dataset.plotted = "yes";
  document.dispatchEvent(new CustomEvent("plotted", { detail: plotted }));
})();
