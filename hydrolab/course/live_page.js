// What the live course's page adds to JupyterLab. Its address names the open chapter, so that a
// reload or a bookmark opens it again; "#cell-id=…" runs the chapter to that cell; and a cell that
// takes its time in a browser (its tag `browser-30` says about 30 s) says so and counts.
"use strict";

const WARM = "import hydrolab\nimport hydrolab.figures, hydrolab.explorers";
const wanted = new URLSearchParams(location.hash.slice(1)).get("cell-id");

async function application() {
  while (!window.jupyterapp) {
    await new Promise(resume => setTimeout(resume, 50));
  }
  return window.jupyterapp;
}

function secondsOf(cell) {
  const tags = cell.model.getMetadata("tags") ?? [];
  return Number(tags.find(tag => tag.startsWith("browser-"))?.slice(8) ?? 0);
}

function tellTimes(panel) {
  const notes = new Map();
  for (const cell of panel.content.widgets) {
    if (!secondsOf(cell)) continue;
    const note = document.createElement("div");
    note.className = "hydrolab-time";
    note.style = "margin-left: 6em; font-size: 90%; opacity: 0.75";
    note.textContent = `In a browser this cell takes about ${secondsOf(cell)} s.`;
    cell.node.append(note);
    notes.set(cell, note);
  }
  let running, started, clock;
  panel.sessionContext.iopubMessage.connect((_, { content, header, parent_header: asked }) => {
    if (header.msg_type === "execute_input") {
      running = [...notes.keys()].find(
        cell => cell.outputArea?.future?.msg.header.msg_id === asked.msg_id);
      started = performance.now();
      clearInterval(clock);
      if (running) clock = setInterval(count, 1000);
    } else if (running && content.execution_state === "idle") {
      count("done");
      clearInterval(clock);
      running = undefined;
    }
  });
  function count(done) {
    const seconds = Math.round((performance.now() - started) / 1000);
    notes.get(running).textContent = done ? `It took ${seconds} s.`
      : `Running: ${seconds} s of about ${secondsOf(running)} s.`;
  }
}

async function runTo(app, panel) {
  const at = panel.content.widgets.findIndex(cell => cell.model.id === wanted);
  if (at < 0) return;
  panel.content.activeCellIndex = at;
  await panel.content.scrollToItem(at, "start");
  await app.commands.execute("notebook:run-all-above");
  await app.commands.execute("notebook:run-cell");
  await panel.content.scrollToItem(at, "start");
}

async function begin(app, panel, first) {
  await panel.context.ready;
  await panel.revealed;
  tellTimes(panel);
  await panel.sessionContext.ready;
  panel.sessionContext.session.kernel.requestExecute(
    { code: WARM, silent: true, store_history: false });
  if (first && wanted) await runTo(app, panel);
}

application().then(app => {
  const known = new Set();
  const show = () => {
    const panel = app.shell.currentWidget;
    const path = panel?.context?.path;
    if (!path) return;
    history.replaceState(null, "", `${location.pathname}?path=${encodeURIComponent(path)}`);
    if (!panel.sessionContext || known.has(panel)) return;
    known.add(panel);
    begin(app, panel, known.size === 1);
  };
  app.shell.currentChanged.connect(show);
  show();
});
