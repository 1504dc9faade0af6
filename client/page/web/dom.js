// Small helpers for elements and numbers.

export function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name === 'text') made.textContent = value;
    else if (value !== undefined) made.setAttribute(name, value);
  }
  made.append(...children);
  return made;
}

export function setText(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

export const DASH = '–';

export function fixed(value, digits) {
  return Number.isFinite(value) ? value.toFixed(digits) : DASH;
}

// "VISIBLE" as "visible", "BEST_ALL_VISIBLE" as "best all visible".
export function plain(word) {
  return word ? word.toLowerCase().replaceAll('_', ' ') : DASH;
}

// A colour of page.css; asked for at every pixel, so kept until the theme changes.
const colours = new Map();
export function colour(name) {
  if (!colours.has(name))
    colours.set(name, getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim());
  return colours.get(name);
}
export function forgetColours() {
  colours.clear();
}

// The same colours as in the pictures of what the camera saw (Okabe & Ito, 2008).
const TARGET_COLOURS = ['#e69f00', '#56b4e9', '#cc79a7', '#f0e442', '#009e73', '#d55e00'];
export function targetColour(index) {
  return TARGET_COLOURS[index % TARGET_COLOURS.length];
}
