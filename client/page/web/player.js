// Which frame is shown: one number that everything else follows, and the clock that moves it.
import { frameAt } from './session.js';

export const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4, 8];

export class Player {
  constructor(session) {
    this.session = session;
    this.frame = 0;
    this.playing = false;
    this.speed = 1;
    this.listeners = [];
  }

  // Called whenever frame, playing or speed has changed.
  onChange(listener) {
    this.listeners.push(listener);
  }

  seek(frame) {
    const wanted = Math.max(0, Math.min(this.session.frames - 1, Math.round(frame)));
    this.time_s = this.session.time_s[wanted];
    if (wanted === this.frame) return;
    this.frame = wanted;
    this.tell();
  }

  seekTime(time_s) {
    this.seek(frameAt(this.session, time_s));
  }

  // Shows at least one frame, and at most the frames of one second.
  stepSecond(forward) {
    this.pause();
    const wanted = frameAt(this.session, this.session.time_s[this.frame] + (forward ? 1 : -1) + 1e-6);
    this.seek(forward ? Math.max(wanted, this.frame + 1) : Math.min(wanted, this.frame - 1));
  }

  step(frames) {
    this.pause();
    this.seek(this.frame + frames);
  }

  toggle() {
    if (this.playing) this.pause();
    else this.play();
  }

  play() {
    if (this.frame === this.session.frames - 1) this.seek(0);
    this.playing = true;
    this.time_s = this.session.time_s[this.frame];
    let last = performance.now();
    const run = (this.run = (now) => {
      if (!this.playing || this.run !== run) return;
      this.advance(((now - last) / 1000) * this.speed);
      last = now;
      requestAnimationFrame(run);
    });
    requestAnimationFrame(run);
    this.tell();
  }

  pause() {
    if (!this.playing) return;
    this.playing = false;
    this.tell();
  }

  setSpeed(speed) {
    this.speed = speed;
    this.tell();
  }

  faster(steps) {
    const at = SPEEDS.indexOf(this.speed) + steps;
    this.setSpeed(SPEEDS[Math.max(0, Math.min(SPEEDS.length - 1, at))]);
  }

  advance(seconds) {
    const time_s = this.time_s + Math.max(0, seconds);
    this.seekTime(time_s);
    this.time_s = time_s;
    if (time_s >= this.session.end_s) this.pause();
  }

  tell() {
    for (const listener of this.listeners) listener();
  }
}
