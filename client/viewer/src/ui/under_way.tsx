import { go } from '../route';
import { sessions } from '../store';
import { progressOf } from './progress';

const mostRows = 3;

/** Sessions that will change the map before long. */
export function UnderWay() {
  const going = (sessions.value ?? []).flatMap((session) => {
    const progress = progressOf(session);
    return progress ? [{ session, progress }] : [];
  });
  if (going.length === 0) return null;
  return (
    <section class="under-way" aria-label="Sessions under way">
      {going.slice(0, mostRows).map(({ session, progress }) => (
        <button key={session.id} onClick={() => go({ page: 'sessions', session: session.id })}>
          <span class="name">{session.id}</span>
          <span class="faint">{progress.text}</span>
          <progress max={1} value={progress.share} aria-label={`Session ${session.id}`} />
        </button>
      ))}
      {going.length > mostRows && <span class="faint">and {going.length - mostRows} more</span>}
    </section>
  );
}
