// What happens on the daemon while the page is open, as server-sent events.

import { eventsUrl } from './api';
import { sessionOf, type Raw, type Session } from './wire';

export interface LiveCallbacks {
  /** The stream is open again: what happened meanwhile is not told. */
  opened(): void;
  broken(): void;
  epoch(epoch: number): void;
  session(session: Session): void;
}

const firstPause = 1000;
const longestPause = 30000;

/** Listens until the returned function is called; comes back after breaks, more and more slowly. */
export function listenToMap(map: string, callbacks: LiveCallbacks): () => void {
  let source: EventSource | null = null;
  let timer = 0;
  let pause = firstPause;

  const parse = (event: MessageEvent): Raw | null => {
    try {
      return JSON.parse(event.data as string) as Raw;
    } catch {
      return null;
    }
  };
  const open = () => {
    source = new EventSource(eventsUrl(map));
    source.onopen = () => {
      pause = firstPause;
      callbacks.opened();
    };
    source.onerror = () => {
      callbacks.broken();
      // The browser tries again by itself only after a broken connection, not after an answer that is no stream.
      if (source?.readyState === EventSource.CLOSED) {
        timer = window.setTimeout(open, pause);
        pause = Math.min(2 * pause, longestPause);
      }
    };
    source.addEventListener('epoch', (event) => {
      const data = parse(event);
      if (data) callbacks.epoch(Number(data.epoch ?? 0));
    });
    source.addEventListener('session', (event) => {
      const data = parse(event);
      if (data) callbacks.session(sessionOf(data));
    });
  };
  open();
  return () => {
    window.clearTimeout(timer);
    source?.close();
  };
}
