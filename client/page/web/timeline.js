// The time line: lanes that are drawn once a zoom, and a cursor above them that is drawn at every frame.
import { colour, fixed, plain } from './dom.js';
import { flagNames, frameAt, marksAt, sightAt, stageTotalUs } from './session.js';
import { GUTTER, makeLanes } from './lanes.js';

const LEAST_WINDOW_S = 0.1;
const shortened = (text) => (text.length > 90 ? `${text.slice(0, 90)}…` : text);

export class Timeline {
  constructor(session, player, root, tip) {
    Object.assign(this, { session, player, root, tip });
    this.base = root.querySelector('#lanes');
    this.over = root.querySelector('#cursor');
    this.lanes = makeLanes(session);
    this.height = this.lanes.reduce((sum, lane) => sum + lane.height, 0) + 6;
    this.showAll();
    root.setAttribute('aria-valuemin', 0);
    root.setAttribute('aria-valuemax', session.frames - 1);
    this.listen();
    player.onChange(() => this.follow());
    new ResizeObserver(() => this.draw()).observe(root);
  }

  // ---- time and place ----

  get width() {
    return this.base.clientWidth;
  }
  xOf(time_s) {
    return GUTTER + ((time_s - this.from_s) / (this.to_s - this.from_s)) * (this.width - GUTTER - 8);
  }
  timeAt(x) {
    return this.from_s + ((x - GUTTER) / (this.width - GUTTER - 8)) * (this.to_s - this.from_s);
  }

  showAll() {
    this.from_s = this.session.start_s;
    this.to_s = Math.max(this.session.end_s, this.session.start_s + LEAST_WINDOW_S);
    this.draw();
  }

  // Zooms about a time; `factor` below 1 shows less.
  zoom(time_s, factor) {
    const all = Math.max(this.session.end_s - this.session.start_s, LEAST_WINDOW_S);
    const span = Math.min(all, Math.max(LEAST_WINDOW_S, (this.to_s - this.from_s) * factor));
    const part = (time_s - this.from_s) / (this.to_s - this.from_s);
    this.show(time_s - part * span, span);
  }

  pan(seconds) {
    this.show(this.from_s + seconds, this.to_s - this.from_s);
  }

  show(from_s, span_s) {
    const { start_s, end_s } = this.session;
    this.from_s = Math.max(start_s, Math.min(end_s - span_s, from_s));
    this.to_s = this.from_s + span_s;
    this.draw();
  }

  // ---- drawing ----

  prepare(canvas) {
    const scale = window.devicePixelRatio || 1;
    const width = this.root.clientWidth;
    canvas.style.height = `${this.height}px`;
    canvas.width = Math.round(width * scale);
    canvas.height = Math.round(this.height * scale);
    const context = canvas.getContext('2d');
    context.setTransform(scale, 0, 0, scale, 0, 0);
    context.font = getComputedStyle(document.body).font;
    context.textBaseline = 'middle';
    return context;
  }

  // At most once a picture of the screen.
  draw() {
    if (this.pending) return;
    this.pending = true;
    requestAnimationFrame(() => {
      this.pending = false;
      if (this.root.clientWidth) this.drawLanes();
    });
  }

  drawLanes() {
    const context = this.prepare(this.base);
    const right = this.width - 8;
    let top = 0;
    for (const lane of this.lanes) {
      lane.top = top;
      context.fillStyle = colour('dim');
      context.fillText(lane.label, 12, top + Math.min(lane.height, lane.labelHeight || lane.height) / 2, GUTTER - 20);
      context.save();
      context.beginPath();
      context.rect(GUTTER, top, right - GUTTER, lane.height);
      context.clip();
      lane.draw(context, this, top, right);
      context.restore();
      top += lane.height;
    }
    this.drawCursor();
  }

  // Calls visit(x, width, first, end) for each stretch of whole pixels with the frames that begin on its first pixel. A
  // frame lasts until the next, so stretches meet and never overlap.
  eachColumn(visit) {
    const right = this.width - 8;
    let open = null;
    for (let x = GUTTER; x < right; x++) {
      const first = this.firstFrameFrom(this.timeAt(x)),
        end = this.firstFrameFrom(this.timeAt(x + 1));
      if (end <= first) continue;
      // A frame that began before the window is drawn from its edge on.
      if (!open && first > 0 && x > GUTTER) visit(GUTTER, x - GUTTER, first - 1, first);
      if (open) visit(open.x, x - open.x, open.first, open.end);
      open = { x, first, end };
    }
    const { session } = this,
      before = frameAt(session, this.from_s);
    if (!open) return visit(GUTTER, right - GUTTER, before, before + 1);
    const next_s = session.time_s[Math.min(open.end, session.frames - 1)];
    const end = Math.min(right, Math.max(open.x + 1, Math.ceil(this.xOf(next_s))));
    visit(open.x, end - open.x, open.first, open.end);
  }

  firstFrameFrom(time_s) {
    const at = frameAt(this.session, time_s);
    return this.session.time_s[at] >= time_s ? at : at + 1;
  }

  drawCursor() {
    const { session, player } = this;
    const context = this.prepare(this.over);
    const time_s = session.time_s[player.frame];
    const x = this.xOf(time_s);
    if (x >= GUTTER - 1) {
      context.fillStyle = colour('accent');
      context.fillRect(Math.round(x) - 0.5, 0, 1, this.height);
      context.beginPath();
      context.moveTo(x - 5, 0);
      context.lineTo(x + 5, 0);
      context.lineTo(x, 7);
      context.fill();
    }
    context.fillStyle = colour('text');
    context.textAlign = 'right';
    for (const lane of this.lanes)
      if (lane.value) context.fillText(lane.value(player.frame), GUTTER - 8, lane.top + lane.height / 2);
    this.root.setAttribute('aria-valuenow', player.frame);
    this.root.setAttribute(
      'aria-valuetext',
      `${fixed(time_s, 3)} seconds, ${plain(session.words[session.status[player.frame]])}`,
    );
  }

  // While playing or stepping, what is shown stays in the window.
  follow() {
    const time_s = this.session.time_s[this.player.frame];
    const span_s = this.to_s - this.from_s;
    if (time_s < this.from_s) this.show(time_s, span_s);
    else if (time_s > this.to_s) this.show(time_s - (this.player.playing ? 0.1 : 1) * span_s, span_s);
    else this.drawCursor();
  }

  // ---- the pointer ----

  listen() {
    const at = (event) => event.clientX - this.root.getBoundingClientRect().left;
    let scrubbing = false;
    this.root.addEventListener('pointerdown', (event) => {
      if (event.button !== 0) return;
      scrubbing = true;
      this.root.setPointerCapture(event.pointerId);
      this.player.pause();
      this.player.seekTime(this.nearest(at(event)));
    });
    this.root.addEventListener('pointermove', (event) => {
      if (scrubbing) this.player.seekTime(this.nearest(at(event)));
      this.showTip(event, at(event));
    });
    this.root.addEventListener('pointerup', () => {
      scrubbing = false;
    });
    this.root.addEventListener('pointercancel', () => {
      scrubbing = false;
    });
    this.root.addEventListener('pointerleave', () => {
      this.tip.hidden = true;
    });
    this.root.addEventListener(
      'wheel',
      (event) => {
        const sideways = Math.abs(event.deltaX) > Math.abs(event.deltaY) || event.shiftKey;
        if (!sideways && !event.ctrlKey && this.root.scrollHeight > this.root.clientHeight + 1) return;
        event.preventDefault();
        const amount = event.deltaX || event.deltaY;
        if (sideways) this.pan((amount / this.width) * (this.to_s - this.from_s));
        else this.zoom(this.timeAt(at(event)), Math.exp(event.deltaY * 0.002));
      },
      { passive: false },
    );
  }

  // The time of the frame nearest to a place.
  nearest(x) {
    const { session } = this,
      time_s = this.timeAt(x),
      frame = frameAt(session, time_s);
    const next = Math.min(session.frames - 1, frame + 1);
    return session.time_s[next] - time_s < time_s - session.time_s[frame]
      ? session.time_s[next]
      : session.time_s[frame];
  }

  // The frames within a few pixels of a place: [first, end).
  framesNear(x) {
    return [this.firstFrameFrom(this.timeAt(x - 5)), this.firstFrameFrom(this.timeAt(x + 5))];
  }

  showTip(event, x) {
    this.tip.hidden = x < GUTTER;
    if (this.tip.hidden) return;
    const { session } = this,
      frame = frameAt(session, this.nearest(x));
    const lines = [
      `${fixed(session.time_s[frame], 3)} s   frame ${frame}`,
      `${plain(session.words[session.status[frame]])} · ${plain(session.words[session.reason[frame]])}${session.cut[frame] ? ' · cut' : ''}`,
    ];
    session.targets
      .map((target, k) => [target, sightAt(session, frame, k)])
      .filter(([, sight]) => sight.present)
      .slice(0, 8)
      .forEach(([target, sight]) =>
        lines.push(`${target.name}  ${fixed(100 * sight.visible, 0)} %  ${plain(sight.state)}`),
      );
    if (session.flags[frame]) lines.push(`flags: ${flagNames(session, frame).join(', ')}`);
    if (session.merged[frame]) lines.push(`merged ticks: ${session.merged[frame]}`);
    lines.push(`step ${fixed(stageTotalUs(session, frame) / 1000, 2)} ms`);
    const near = this.framesNear(x);
    for (const { kind, text } of marksAt(session, ...near).slice(0, 4)) lines.push(`${kind}: ${shortened(text)}`);
    this.tip.textContent = lines.join('\n');
    this.tip.style.left = `${Math.min(x + 12, this.width - this.tip.offsetWidth - 8)}px`;
  }
}
