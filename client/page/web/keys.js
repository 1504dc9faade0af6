// The function of each key. The help lists the same table.

export function makeKeys({ player, events, view, timeline, press, help }) {
  const event = (forward) => {
    player.pause();
    const found = forward
      ? events.find((frame) => frame > player.frame)
      : events.findLast((frame) => frame < player.frame);
    if (found !== undefined) player.seek(found);
  };
  const zoom = (factor) => timeline.zoom(player.session.time_s[player.frame], factor);
  return {
    event,
    table: [
      [[' '], 'space', 'Play or pause', () => player.toggle()],
      [
        ['ArrowRight'],
        '→',
        'One frame forward; with shift one second',
        (key) => (key.shiftKey ? player.stepSecond(true) : player.step(1)),
      ],
      [
        ['ArrowLeft'],
        '←',
        'One frame back; with shift one second',
        (key) => (key.shiftKey ? player.stepSecond(false) : player.step(-1)),
      ],
      [['Home'], 'Home', 'First frame', () => player.step(-Infinity)],
      [['End'], 'End', 'Last frame', () => player.step(Infinity)],
      [[']'], ']', 'Next change of status or reason, cut or event', () => event(true)],
      [['['], '[', 'Former change of status or reason, cut or event', () => event(false)],
      [['.'], '.', 'Faster', () => player.faster(1)],
      [[','], ',', 'Slower', () => player.faster(-1)],
      [['+', '='], '+', 'Zoom in on the time line', () => zoom(0.5)],
      [['-'], '−', 'Zoom out', () => zoom(2)],
      [['0'], '0', 'The whole session', () => timeline.showAll()],
      [['c'], 'C', 'From outside, or through the camera', () => view && press('swap')],
      [['f'], 'F', 'Follow the targets', () => view && press('follow')],
      [['k'], 'K', 'Cut away what is above the targets', () => view && press('cut')],
      [['x'], 'X', 'See through the scene', () => view && press('xray')],
      [['1'], '1', 'Candidate cells', () => view && press('cells')],
      [['2'], '2', 'Sight lines and what blocks them', () => view && press('sight')],
      [['3'], '3', 'Paths', () => view && press('path')],
      [['4'], '4', 'The camera of the asked shot', () => view && press('shot')],
      [['l'], 'L', 'Light or dark', () => press('theme')],
      [['?'], '?', 'This help', () => help()],
    ],
  };
}
