// Elements of pages, for every script of theirs.
(() => {
  "use strict";
  const mapmore = (window.mapmore = window.mapmore ?? { models: {} });

  /** An element with properties and children; texts stay texts. */
  function element(tag, properties = {}, ...children) {
    const made = document.createElement(tag);
    for (const [name, value] of Object.entries(properties)) {
      if (name in made) made[name] = value;
      else made.setAttribute(name, value);
    }
    made.append(...children);
    return made;
  }

  function button(text, pressed, properties = {}) {
    const made = element("button", { type: "button", ...properties }, text);
    made.addEventListener("click", pressed);
    return made;
  }

  /** A button that copies the text of an element; a page from a file may have no clipboard. */
  function copier(of) {
    const made = button("Copy", async () => {
      getSelection()?.selectAllChildren(of);
      try {
        await navigator.clipboard.writeText(of.textContent);
      } catch {
        document.execCommand("copy");
      }
      made.textContent = "Copied";
    }, { className: "save" });
    return made;
  }

  Object.assign(mapmore, { element, button, copier });
})();
