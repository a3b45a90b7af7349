import { useEffect, useRef } from 'preact/hooks';
import { helpOpen } from '../stage_state';
import { Icon } from './icons';
import { keyList } from './keys';

export function HelpDialog() {
  const dialog = useRef<HTMLDialogElement>(null);
  const open = helpOpen.value;
  useEffect(() => {
    if (open) dialog.current?.showModal();
    else dialog.current?.close();
  }, [open]);
  return (
    <dialog ref={dialog} aria-labelledby="help-title" onClose={() => (helpOpen.value = false)}>
      <header>
        <h2 id="help-title">Keys and gestures</h2>
        <button class="round" aria-label="Close" onClick={() => (helpOpen.value = false)}><Icon name="close" /></button>
      </header>
      <dl class="facts keys">
        {keyList.map(([key, what]) => [<dt key={key}><kbd>{key}</kbd></dt>, <dd key={`${key} does`}>{what}</dd>])}
      </dl>
      <p class="faint">Mouse: drag moves, right drag turns, wheel zooms, a click asks. Touch: one finger moves, two turn and zoom, a tap asks.</p>
    </dialog>
  );
}
