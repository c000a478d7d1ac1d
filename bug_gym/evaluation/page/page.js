"use strict";
// Texts come into the page as text nodes only, so that a name is never read as HTML.

const NOTHING = "\u2013";
const STEP = 200; // lines of the table of episodes that are added at a time
const data = JSON.parse(document.getElementById("data").textContent);

function make(name, content = "", attributes = {}) {
  const made = document.createElement(name);
  made.append(content);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  return made;
}

// -- Sorting ----------------------------------------------------------------------------------------------------------

// A column is sorted by number where every cell begins with one; what is missing comes last either way.
function sorted(items, valueOf, sign) {
  const keyed = items.map((item) => [valueOf(item), item]);
  const isMissing = (value) => value === null || value === NOTHING || value === "";
  const known = keyed.filter(([value]) => !isMissing(value));
  const isNumber = known.every(([value]) => /^[+-]?(\d|inf)/.test(value));
  const number = (value) => (/^[+-]?inf/.test(value) ? parseFloat(String(value).replace("inf", "Infinity")) : parseFloat(value));
  const compare = isNumber
    ? (a, b) => number(a[0]) - number(b[0])
    : (a, b) => String(a[0]).localeCompare(String(b[0]), "en", { numeric: true });
  known.sort((a, b) => sign * compare(a, b));
  return [...known, ...keyed.filter(([value]) => isMissing(value))].map(([, item]) => item);
}

// Makes the names of columns into buttons; `sort(column, sign)` puts the lines in order.
function makeSortable(table, sort) {
  const heads = [...table.tHead.rows[0].cells];
  heads.forEach((head, column) => {
    const button = make("button", head.textContent, { type: "button" });
    head.replaceChildren(button);
    button.addEventListener("click", () => {
      // Names from A on, numbers from the greatest on; a second click turns it round.
      const top = table.tBodies[0].rows[0]?.cells[column]?.textContent.trim() ?? "";
      const first = top === NOTHING || /^[+-]?\d/.test(top) ? "descending" : "ascending";
      const other = first === "ascending" ? "descending" : "ascending";
      const order = head.getAttribute("aria-sort") === first ? other : first;
      heads.forEach((one) => one.removeAttribute("aria-sort"));
      head.setAttribute("aria-sort", order);
      sort(column, order === "ascending" ? 1 : -1);
    });
  });
}

for (const table of document.querySelectorAll("table.sortable")) {
  const body = table.tBodies[0];
  makeSortable(table, (column, sign) =>
    body.append(...sorted([...body.rows], (row) => row.cells[column].textContent.trim(), sign)));
}

// -- The table of episodes ----------------------------------------------------------------------------------------------

const choices = data.names.map((names, column) => {
  if (!names || names.length < 2) return null;
  const select = make("select");
  select.append(make("option", "all", { value: "" }));
  names.forEach((name, number) => select.append(make("option", name, { value: number })));
  const label = make("label", data.columns[column] + " ");
  label.append(select);
  document.getElementById("choices").append(label);
  select.addEventListener("change", () => showRows());
  return select;
});
const shownColumns = data.columns.map((_, column) => column)
  .filter((column) => data.rows.some((row) => row[column] !== null) && (data.columns[column] !== "robot" || data.rows.some((row) => row[column])));
const replays = new Map(data.replays.map((key, number) => [key.join(), number]));
const replayOf = (row) => replays.get(row.slice(0, 3).join());
const textOf = (row, column) => (data.names[column] ? data.names[column][row[column]] : row[column]);

let ordered = data.rows;
const table = make("table"), head = make("tr"), body = make("tbody"), count = make("p", "", { class: "told" });
const more = make("button", "more", { type: "button" });
shownColumns.forEach((column) => head.append(make("th", data.columns[column], { scope: "col" })));
table.append(make("thead", head), body);
document.getElementById("rows").append(count, table, more);
makeSortable(table, (place, sign) => {
  ordered = sorted(data.rows, (row) => textOf(row, shownColumns[place]), sign);
  showRows();
});

let waiting = [];
function showRows() {
  waiting = ordered.filter((row) =>
    isWanted(data.names[0][row[0]]) && choices.every((select, column) => !select || !select.value || row[column] === Number(select.value)));
  count.textContent = `${waiting.length.toLocaleString("en")} of ${data.rows.length.toLocaleString("en")}`;
  body.replaceChildren();
  addRows();
}

function addRows() {
  body.append(...waiting.slice(0, STEP).map((row) => {
    const line = make("tr");
    shownColumns.forEach((column) => {
      const value = textOf(row, column);
      line.append(column < 2 ? make("th", value, { scope: "row" }) : make("td", value === null ? NOTHING : String(value)));
    });
    const replay = replayOf(row);
    if (replay !== undefined) {
      const seed = line.cells[shownColumns.indexOf(2)];
      seed.replaceChildren(make("button", seed.textContent, { type: "button", class: "replayed", "data-replay": replay }));
    }
    return line;
  }));
  waiting = waiting.slice(STEP);
  more.hidden = waiting.length === 0;
}
more.addEventListener("click", addRows);

// -- Replays -----------------------------------------------------------------------------------------------------------

const dialog = document.getElementById("replay"), beside = document.getElementById("beside");
const nameOf = (number) => `${data.names[0][data.replays[number][0]]}, ${data.names[1][data.replays[number][1]]}, seed ${data.replays[number][2]}`;
let player = null, first = 0;

function opened(number) {
  return Replay.unpack(document.getElementById(`replay-${number}`).textContent);
}

// Plays an episode, and another one beside it where one is chosen: those of the same world come first.
async function replay(number, other = "") {
  player?.pause();
  const root = make("div");
  document.getElementById("player").replaceChildren(root);
  if (!dialog.open) dialog.showModal();
  try {
    const episodes = await Promise.all([number, ...(other === "" ? [] : [other])].map(opened));
    player = Replay.mount(root, episodes);
    root.focus();
  } catch (error) {
    root.textContent = `This episode cannot be read: ${error}`;
  }
}

function offerOthers(number) {
  const isSame = (other) => other[1] === data.replays[number][1] && other[2] === data.replays[number][2];
  const others = data.replays.map((_, other) => other).filter((other) => other !== number);
  others.sort((a, b) => Number(isSame(data.replays[b])) - Number(isSame(data.replays[a])) || a - b);
  beside.replaceChildren(make("option", "nothing", { value: "" }), ...others.map((other) => make("option", nameOf(other), { value: other })));
}

document.addEventListener("click", ({ target }) => {
  const button = target.closest?.("button[data-replay]");
  if (!button) return;
  first = Number(button.dataset.replay);
  offerOthers(first);
  replay(first);
});
beside.addEventListener("change", () => replay(first, beside.value));
document.getElementById("close").addEventListener("click", () => dialog.close());
dialog.addEventListener("close", () => player?.pause());

// -- Filtering by policy --------------------------------------------------------------------------------------------------

const filter = document.getElementById("filter");
let words = [];
function isWanted(policy) {
  return words.length === 0 || words.some((word) => policy.toLowerCase().includes(word));
}

filter.addEventListener("input", () => {
  words = filter.value.toLowerCase().split(/[\s,]+/).filter(Boolean);
  for (const row of document.querySelectorAll("tr[data-policy]")) row.hidden = !isWanted(row.dataset.policy);
  showRows();
});

document.querySelectorAll(".scripted").forEach((one) => { one.hidden = false; });
showRows();
