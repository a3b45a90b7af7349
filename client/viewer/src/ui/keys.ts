// What keys do. The canvas' own controls move with the arrows (with Shift: turn) once it has the focus.

import { colourModes } from '../view/ramps';
import { go, mapName, page } from '../route';
import { asked, helpOpen, measured, tool, view } from '../stage_state';
import { step } from './timeline';
import { toggleMeasuring } from './toolbar';

export const keyList: [string, string][] = [
  ['Arrows', 'move (map in focus)'],
  ['Shift + arrows', 'turn'],
  ['+ / -', 'closer, farther'],
  ['Enter', 'ask about, or measure from, the middle'],
  ['H', 'whole map'],
  ['T', 'from above'],
  ['1 to 5', 'colour by height, stability, ground, age, intensity'],
  ['[ and ]', 'epoch before, epoch after'],
  ['C', 'what changed'],
  ['S', 'sessions'],
  ['M', 'measure'],
  ['Esc', 'close, stop'],
  ['?', 'this list'],
];

function escape(): void {
  asked.value = null;
  measured.value = [];
  tool.value = 'look';
}

const actions: Record<string, () => void> = {
  '+': () => view.value?.zoom(0.8),
  '=': () => view.value?.zoom(0.8),
  '-': () => view.value?.zoom(1.25),
  h: () => view.value?.home(),
  t: () => view.value?.home(true),
  '[': () => step(-1),
  ']': () => step(1),
  c: () => go({ page: page.value === 'changes' ? 'map' : 'changes' }),
  s: () => go({ page: page.value === 'sessions' ? 'map' : 'sessions' }),
  m: toggleMeasuring,
  '?': () => (helpOpen.value = true),
  Escape: escape,
};
colourModes.forEach((colour, i) => (actions[String(i + 1)] = () => go({ colour })));

export function listenToKeys(): () => void {
  const pressed = (event: KeyboardEvent) => {
    const target = event.target as HTMLElement;
    if (event.ctrlKey || event.metaKey || event.altKey || mapName.value === null) return;
    if (target.closest('dialog, select, textarea, input:not([type=range], [type=radio], [type=checkbox])')) return;
    if (event.key === 'Enter' && target.id === 'map-canvas') {
      view.value?.pickCentre();
      return;
    }
    const action = actions[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!action) return;
    event.preventDefault();
    action();
  };
  window.addEventListener('keydown', pressed);
  return () => window.removeEventListener('keydown', pressed);
}
