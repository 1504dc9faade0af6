// Puts the page together: the session, the frame that is shown, and the three views of it.
import { element, fixed, forgetColours, setText } from './dom.js';
import { makeKeys } from './keys.js';
import { FramePanel, showRun, showSettings } from './panel.js';
import { Player, SPEEDS } from './player.js';
import { SceneView } from './scene_view.js';
import { eventFrames, readSession, textAt } from './session.js';
import { Timeline } from './timeline.js';

const get = (id) => document.getElementById(id);

function showHeader(session) {
  get('title').textContent = session.title;
  for (const [name, value] of session.facts)
    get('facts').append(element('div', {}, element('dt', { text: name }), element('dd', { text: value })));
}

function showNotices(session) {
  get('notices').hidden = !session.notices.length;
  for (const text of session.notices) get('notices').querySelector('ul').append(element('li', { text }));
  get('notices-close').onclick = () => {
    get('notices').hidden = true;
  };
}

// Without WebGL everything else still works.
function makeView(session, player) {
  try {
    return new SceneView(session, player, get('view'));
  } catch (trouble) {
    console.warn('no 3D view:', trouble);
    get('no-webgl').hidden = false;
    for (const part of document.querySelectorAll('.toolbar, .legend, #inset')) part.hidden = true;
    return null;
  }
}

// ---- light and dark: the system's choice until one is made here ----

function makeTheme(onChange) {
  const system = window.matchMedia('(prefers-color-scheme: light)');
  let chosen = null;
  const apply = () => {
    document.documentElement.dataset.theme = chosen || (system.matches ? 'light' : 'dark');
    forgetColours();
    onChange();
  };
  system.addEventListener('change', apply);
  apply();
  return () => {
    chosen = document.documentElement.dataset.theme === 'light' ? 'dark' : 'light';
    apply();
  };
}

// ---- the buttons above the 3D view ----

function wireView(view) {
  const showThrough = () => {
    get('view-orbit').setAttribute('aria-pressed', !view.through);
    get('view-camera').setAttribute('aria-pressed', view.through);
    setText(get('inset-label'), view.through ? 'From outside' : 'Through the camera');
  };
  const through = (on) => {
    view.setThrough(on);
    showThrough();
  };
  get('view-orbit').onclick = () => through(false);
  get('view-camera').onclick = () => through(true);
  get('inset').onclick = () => through(!view.through);
  showThrough();
  for (const button of document.querySelectorAll('[data-toggle]')) {
    const name = button.dataset.toggle;
    button.setAttribute('aria-pressed', view.shows[name]);
    button.onclick = () => {
      view.set(name, !view.shows[name]);
      button.setAttribute('aria-pressed', view.shows[name]);
    };
  }
}

function wireTransport(player, events, timeline) {
  const speed = get('speed');
  for (const value of SPEEDS) speed.append(element('option', { value, text: `${value}×` }));
  speed.onchange = () => player.setSpeed(Number(speed.value));
  get('play').onclick = () => player.toggle();
  get('first').onclick = () => player.step(-Infinity);
  get('last').onclick = () => player.step(Infinity);
  get('back').onclick = () => player.step(-1);
  get('forward').onclick = () => player.step(1);
  get('event-back').onclick = () => events(false);
  get('event-forward').onclick = () => events(true);
  get('zoom-all').onclick = () => timeline.showAll();
}

function showTransport(session, player) {
  setText(get('play'), player.playing ? '❚❚' : '▶');
  get('play').setAttribute('aria-label', player.playing ? 'Pause' : 'Play');
  get('speed').value = String(player.speed);
  setText(
    get('clock'),
    `${fixed(session.time_s[player.frame], 3)} / ${fixed(session.end_s, 3)} s   frame ${player.frame}`,
  );
  setText(get('now-text'), textAt(session, player.frame));
}

function wireTabs() {
  const tabs = [...document.querySelectorAll('[role="tab"]')];
  const choose = (tab) => {
    for (const each of tabs) {
      each.setAttribute('aria-selected', each === tab);
      each.tabIndex = each === tab ? 0 : -1;
      get(each.getAttribute('aria-controls')).hidden = each !== tab;
    }
  };
  tabs.forEach((tab, i) => {
    tab.onclick = () => choose(tab);
    tab.onkeydown = (event) => {
      const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (!step) return;
      event.stopPropagation();
      const next = tabs[(i + step + tabs.length) % tabs.length];
      choose(next);
      next.focus();
    };
  });
}

function wireKeys(keys) {
  for (const [, name, what] of keys.table)
    get('help')
      .querySelector('dl')
      .append(element('dt', {}, element('kbd', { text: name })), element('dd', { text: what }));
  document.addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || get('help').open) return;
    const owner = event.target.closest('select, button, [role="tab"]');
    // The focused element keeps the keys that it uses itself.
    if (owner && (event.key === ' ' || (owner.tagName === 'SELECT' && event.key.startsWith('Arrow')))) return;
    const found = keys.table.find(([names]) =>
      names.includes(event.key.length === 1 ? event.key.toLowerCase() : event.key),
    );
    if (!found) return;
    event.preventDefault();
    found[3](event);
  });
}

// "#frame=120" opens the page there, and the address follows what is shown when it rests.
function wireAddress(player) {
  if (window.parent !== window) return; // one of two pages side by side: it has no address of its own
  const read = () => {
    const frame = /^#frame=(\d+)$/.exec(window.location.hash);
    if (frame) player.seek(Number(frame[1]));
  };
  window.addEventListener('hashchange', read);
  let timer = 0;
  player.onChange(() => {
    clearTimeout(timer);
    if (!player.playing) timer = setTimeout(() => window.history.replaceState(null, '', `#frame=${player.frame}`), 300);
  });
  read();
}

async function start() {
  const session = await readSession(document);
  const player = new Player(session);
  showHeader(session);
  showNotices(session);
  let view = null,
    timeline = null;
  const toggleTheme = makeTheme(() => {
    view?.recolour();
    timeline?.draw();
  });
  const panel = new FramePanel(session, get('panel-frame'));
  showRun(session, get('panel-run'), (frame) => (player.pause(), player.seek(frame)));
  showSettings(session, get('panel-settings'));
  view = makeView(session, player);
  if (view) wireView(view);
  timeline = new Timeline(session, player, get('timeline'), get('tip'));

  const press = (name) => {
    if (name === 'swap') get('inset').click();
    else if (name === 'theme') toggleTheme();
    else document.querySelector(`[data-toggle="${name}"]`).click();
  };
  const help = () => get('help').showModal();
  const keys = makeKeys({ player, events: eventFrames(session), view, timeline, press, help });
  get('theme').onclick = toggleTheme;
  get('help-button').onclick = help;
  wireTransport(player, keys.event, timeline);
  wireTabs();
  wireKeys(keys);
  player.onChange(() => {
    panel.show(player.frame);
    view?.show();
    showTransport(session, player);
  });
  player.tell();
  wireAddress(player);
  document.body.dataset.ready = 'true';
  window.sightline = { session, player, view, timeline };
}

start().catch((trouble) => {
  console.error(trouble);
  document.querySelector('main').textContent = `This page cannot be shown: ${trouble.message}`;
});
