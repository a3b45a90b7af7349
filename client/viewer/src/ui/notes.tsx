import { dismiss, notes } from '../store';
import { Icon } from './icons';

/** What happened meanwhile, read out to those who do not see it. */
export function Notes() {
  return (
    <div class="notes" aria-live="polite">
      {notes.value.map((note) => (
        <div key={note.id} class={`note ${note.kind}`}>
          <span>{note.text}</span>
          <button class="round" aria-label="Dismiss" onClick={() => dismiss(note.id)}><Icon name="close" /></button>
        </div>
      ))}
    </div>
  );
}
