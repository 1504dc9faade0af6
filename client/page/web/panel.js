// The numbers: of the frame that is shown, of the whole run, and the settings. Every number of a frame has its name in
// data-field.
import { DASH, element, fixed, plain, setText, targetColour } from './dom.js';
import {
  cellRowAt,
  flagNames,
  isTrouble,
  look,
  marksAt,
  occluderName,
  pictureAt,
  shotAt,
  sightAt,
  stageTotalUs,
} from './session.js';

function group(title, ...children) {
  return element('section', { class: 'group' }, element('h3', {}, element('b', { text: title })), ...children);
}

function pairs(rows) {
  const list = element('dl', { class: 'pairs' });
  for (const [name, field] of rows) list.append(element('dt', { text: name }), element('dd', { 'data-field': field }));
  return list;
}

// Two pairs a line.
function grid(rows) {
  const list = pairs(rows);
  list.classList.add('two');
  return list;
}

export class FramePanel {
  constructor(session, root) {
    Object.assign(this, { session, root });
    root.append(
      element(
        'section',
        { class: 'group' },
        element(
          'div',
          { class: 'decision' },
          element('span', { class: 'chip', 'data-field': 'status' }),
          element('span', { class: 'chip', 'data-field': 'reason' }),
          element('span', { class: 'chip alert', 'data-field': 'cut', hidden: '' }),
        ),
        element('ul', { id: 'frame-events', class: 'events' }),
      ),
      this.shotGroup(),
      group('Targets', this.targetTable()),
      group(
        'Camera',
        pairs([
          ['position, m', 'position'],
          ['rotation x y z w', 'rotation'],
          ['field of view', 'fov'],
          ['speed', 'speed'],
          ['nearest collider', 'clearance'],
        ]),
      ),
      group(
        'Places',
        element('div', { class: 'bar', id: 'cell-bar' }),
        grid([
          ['all seen, S_V', 'all_visible'],
          ['some, S_P', 'some_visible'],
          ['none, S_N', 'none_visible'],
          ['cells of frame', 'cells_of'],
        ]),
      ),
      group('Step', element('div', { class: 'bar', id: 'stage-bar' }), this.stageGrid()),
      group(
        'Tick',
        grid([
          ['frame', 'frame'],
          ['sequence', 'sequence'],
          ['time', 'time'],
          ['queue', 'queue'],
          ['latency', 'latency'],
          ['merged ticks', 'merged'],
          ['flags', 'flags'],
        ]),
      ),
      this.pictureGroup(),
    );
    this.fields = new Map([...root.querySelectorAll('[data-field]')].map((node) => [node.dataset.field, node]));
    this.cellBar = this.bars('cell-bar', ['seen', 'part', 'hidden']);
    this.worthBar = root.querySelector('#worth-bar') && this.bars('worth-bar', ['seen']);
    this.stageBar = this.bars(
      'stage-bar',
      session.stages.map((_, i) => `stage-${i % 6}`),
    );
  }

  bars(id, colours) {
    const bar = this.root.querySelector(`#${id}`);
    bar.setAttribute('aria-hidden', 'true');
    bar.append(...colours.map((name) => element('i', { style: `background:var(--${name})` })));
    return [...bar.children];
  }

  targetTable() {
    const head = element(
      'tr',
      {},
      ...['', 'now', 'filtered', 'true', 'distance'].map((text, i) =>
        element('th', { text, scope: 'col', class: i ? 'number' : undefined }),
      ),
    );
    const body = element('tbody');
    this.session.targets.forEach((target, k) => {
      const name = element(
        'td',
        { class: 'name', title: `${target.name}, weight ${target.weight}${target.required ? ', required' : ''}` },
        element('span', { class: 'swatch', style: `background:${targetColour(k)}` }),
        target.name,
      );
      body.append(
        element(
          'tr',
          {},
          name,
          ...['visible', 'filtered', 'true', 'distance'].map((field) =>
            element('td', { class: 'number', 'data-field': `${field}-${k}` }),
          ),
        ),
        element(
          'tr',
          { class: 'detail' },
          element(
            'td',
            { colspan: 5 },
            element('span', { class: 'state', 'data-field': `state-${k}` }),
            ' ',
            element('span', { 'data-field': `blocker-${k}` }),
          ),
        ),
      );
    });
    return element('table', {}, element('thead', {}, head), body);
  }

  // What was asked for, what the picture has, and why they differ.
  shotGroup() {
    if (![...this.session.worth].some(Number.isFinite)) return '';
    const head = ['', 'asked', 'now', 'off'].map((text, i) =>
      element('th', { text, scope: 'col', class: i ? 'number' : undefined }),
    );
    const rows = ['side', 'height', 'distance'].map((term) =>
      element(
        'tr',
        {},
        element('td', { class: 'name', text: term }),
        ...['asked', 'now', 'off'].map((field) => element('td', { class: 'number', 'data-field': `${term}-${field}` })),
      ),
    );
    const made = group(
      'Shot',
      element('div', { class: 'bar', id: 'worth-bar' }),
      element('table', {}, element('thead', {}, element('tr', {}, ...head)), element('tbody', {}, ...rows)),
      pairs([
        ['lost from sight', 'sight_loss'],
        ['off its place', 'off_place'],
        ['in the way', 'in_the_way'],
        ['course', 'course'],
        ['expected loss', 'losses'],
      ]),
    );
    made.querySelector('h3').append(element('span', { 'data-field': 'worth' }));
    return made;
  }

  pictureGroup() {
    if (!this.session.pictures.length) return '';
    const image = element('img', { id: 'picture', alt: '' });
    image.style.aspectRatio = this.session.aspect;
    const made = group('What the camera saw', element('figure', {}, image));
    made.querySelector('h3').append(element('span', { 'data-field': 'picture_of' }));
    return made;
  }

  stageGrid() {
    const list = grid([...this.session.stages.map((stage, i) => [stage, `stage-${i}`]), ['total', 'total']]);
    [...list.querySelectorAll('dt')]
      .slice(0, -1)
      .forEach((name, i) =>
        name.prepend(element('span', { class: 'swatch square', style: `background:var(--stage-${i % 6})` })),
      );
    return list;
  }

  set(field, text) {
    setText(this.fields.get(field), text);
  }

  show(frame) {
    this.showDecision(frame);
    this.showShot(frame);
    this.session.targets.forEach((_, k) => this.showTarget(frame, k));
    this.showCamera(frame);
    this.showCells(frame);
    this.showStep(frame);
    this.showPicture(frame);
  }

  showDecision(frame) {
    const { session } = this;
    this.set('status', plain(session.words[session.status[frame]]));
    this.set('reason', plain(session.words[session.reason[frame]]));
    this.set('cut', 'cut');
    this.fields.get('cut').hidden = !session.cut[frame];
    this.root.querySelector('#frame-events').replaceChildren(...marksAt(session, frame).map((mark) => markItem(mark)));
  }

  showShot(frame) {
    if (!this.worthBar) return;
    const shot = shotAt(this.session, frame);
    const set = (field, text) => this.set(field, shot ? text() : DASH);
    const percent = (share) => `${fixed(100 * share, 0)} %`;
    set('worth', () => `worth ${fixed(shot.worth, 2)}`);
    this.worthBar[0].style.width = `${100 * (shot ? shot.worth : 0)}%`;
    for (const { term, asked, now, off } of shot ? shot.terms : []) {
      const text = (value) => (term === 'distance' ? `${fixed(value, 1)} m` : `${fixed((value * 180) / Math.PI, 0)}°`);
      this.set(`${term}-asked`, text(asked));
      this.set(`${term}-now`, text(now));
      this.set(`${term}-off`, percent(off));
    }
    set('sight_loss', () => percent(shot.sightLoss));
    set('off_place', () => percent(shot.offPlace));
    set('in_the_way', () => inTheWay(shot));
    set('course', () => plain(shot.course));
    set('losses', () =>
      shot.losses
        .filter(({ loss }) => Number.isFinite(loss))
        .map(({ course, loss }) => `${plain(course)} ${percent(loss)}`)
        .join(', ') || DASH,
    );
  }

  showTarget(frame, k) {
    const sight = sightAt(this.session, frame, k);
    const percent = (share) => (Number.isNaN(share) || !sight.present ? DASH : `${fixed(100 * share, 1)} %`);
    this.set(`visible-${k}`, percent(sight.visible));
    this.set(`filtered-${k}`, percent(sight.filtered));
    this.set(`true-${k}`, percent(sight.truth));
    this.set(`distance-${k}`, sight.present ? `${fixed(sight.distance, 2)} m` : DASH);
    this.set(`state-${k}`, sight.present ? plain(sight.state) : 'no target now');
    this.fields.get(`state-${k}`).className = `state ${look(sight.state)}`;
    this.set(
      `blocker-${k}`,
      sight.occluder === null || !sight.present
        ? ''
        : `behind ${occluderName(this.session, sight.occluder)} (${fixed(100 * sight.occluderShare, 0)} % hidden)`,
    );
  }

  showCamera(frame) {
    const { session } = this,
      camera = session.camera.subarray(7 * frame, 7 * frame + 7);
    const velocity = session.velocity_mps.subarray(3 * frame, 3 * frame + 3);
    this.set('position', [...camera.subarray(0, 3)].map((value) => fixed(value, 3)).join('  '));
    this.set('rotation', [...camera.subarray(3)].map((value) => fixed(value, 4)).join('  '));
    this.set('fov', `${fixed((session.fov_rad[frame] * 180) / Math.PI, 2)}° vertical`);
    this.set('speed', `${fixed(Math.hypot(...velocity), 2)} m/s`);
    this.set(
      'clearance',
      Number.isNaN(session.clearance_m[frame]) ? DASH : `${fixed(session.clearance_m[frame], 2)} m${session.clearance_m[frame] === session.clearance_reach_m ? ' or more' : ''}`,
    );
  }

  showCells(frame) {
    const { session } = this,
      counts = [0, 1, 2].map((i) => session.counts[3 * frame + i]);
    const all = Math.max(1, counts[0] + counts[1] + counts[2]);
    ['all_visible', 'some_visible', 'none_visible'].forEach((field, i) => {
      this.set(field, String(counts[i]));
      this.cellBar[i].style.width = `${(100 * counts[i]) / all}%`;
    });
    const row = cellRowAt(session, frame);
    this.set('cells_of', row < 0 ? DASH : String(session.cell_frame[row]));
  }

  showStep(frame) {
    const { session } = this,
      count = session.stages.length,
      total = stageTotalUs(session, frame);
    for (let i = 0; i < count; i++) {
      const us = session.stage_us[frame * count + i];
      this.set(`stage-${i}`, `${fixed(us, 1)} µs`);
      this.stageBar[i].style.width = `${(100 * us) / Math.max(total, 1e-9)}%`;
    }
    this.set('total', `${fixed(total, 1)} µs`);
    this.set('frame', `${frame} of ${session.frames}`);
    this.set('sequence', String(session.sequence[frame]));
    this.set('time', `${fixed(session.time_s[frame], 4)} s`);
    this.set('latency', Number.isNaN(session.latency_ms[frame]) ? DASH : `${fixed(session.latency_ms[frame], 2)} ms`);
    this.set('queue', Number.isNaN(session.queue_us[frame]) ? DASH : `${fixed(session.queue_us[frame], 1)} µs`);
    this.set('merged', String(session.merged[frame]));
    const flags = flagNames(session, frame);
    this.set('flags', flags.length ? flags.join(', ') : 'none');
  }

  showPicture(frame) {
    const { session } = this,
      at = pictureAt(session, frame);
    if (at === this.picture || !session.pictures.length) return;
    this.picture = at;
    const image = this.root.querySelector('#picture');
    if (at < 0) return image.removeAttribute('src');
    const { url, frame: of } = session.pictures[at];
    image.src = url;
    image.alt = `What the camera saw at ${fixed(session.time_s[of], 2)} seconds`;
    this.set('picture_of', `frame ${of}, ${fixed(session.time_s[of], 2)} s`);
  }
}

function inTheWay({ hiddenBy, hiddenTarget, hiddenIn_s }) {
  if (hiddenBy === null) return 'nothing';
  return Number.isFinite(hiddenIn_s) ? `${hiddenBy} will hide ${hiddenTarget} in ${fixed(hiddenIn_s, 1)} s` : `${hiddenBy} hides ${hiddenTarget}`;
}

function markItem({ kind, text }, ...before) {
  return element(
    'li',
    { class: isTrouble({ kind }) ? 'trouble' : 'note' },
    ...before,
    element('b', { text: kind }),
    ' ',
    text,
  );
}

const MOST_LISTED = 500;

// `seek` shows a frame.
function eventList(session, seek) {
  const items = session.marks.slice(0, MOST_LISTED).map((mark) => {
    const go = element('button', { type: 'button', text: `${fixed(session.time_s[mark.frame], 2)} s` });
    go.onclick = () => seek(mark.frame);
    return markItem(mark, go, ' ');
  });
  const more = session.marks.length - items.length;
  if (more > 0) items.push(element('li', { text: `and ${more} more on the time line` }));
  return group('Events', element('ul', { class: 'events', id: 'events' }, ...items));
}

export function showRun(session, root, seek) {
  if (session.marks.length) root.append(eventList(session, seek));
  const head = element(
    'tr',
    {},
    element('th', { scope: 'col', text: '' }),
    ...session.columns.map((text) => element('th', { class: 'number', scope: 'col', text })),
  );
  const rows = session.figures.map(({ name, values }) => {
    // A long text that belongs to one column alone takes the width of all columns.
    const filled = values.filter((text) => text !== '');
    const cells =
      filled.length === 1
        ? [element('td', { class: 'number', colspan: values.length, text: filled[0] })]
        : values.map((text) => element('td', { class: 'number', text }));
    return element('tr', {}, element('td', { text: name }), ...cells);
  });
  root.append(group('Figures', element('table', {}, element('thead', {}, head), element('tbody', {}, ...rows))));
}

export function showSettings(session, root) {
  const facts = element('dl', { class: 'pairs' });
  for (const [name, value] of session.facts)
    facts.append(element('dt', { text: name }), element('dd', { text: value }));
  root.append(group('Session', facts));
  for (const { title, value } of session.settings)
    root.append(group(title, element('pre', { text: value ? JSON.stringify(value, null, 2) : 'not known' })));
}
