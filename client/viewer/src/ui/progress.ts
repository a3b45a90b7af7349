// How far a session is that is still on its way.

import type { Session } from '../api/wire';
import { count, percent } from './format';

export function progressOf(session: Session): { share: number; text: string } | null {
  if (session.state === 'uploading') {
    const share = session.scanCount > 0 ? session.durableScans / session.scanCount : 0;
    return { share, text: `${count(session.durableScans)} of ${count(session.scanCount)} scans are safe` };
  }
  if (session.state === 'queued') return { share: 0, text: 'waits for a worker' };
  if (session.state !== 'running') return null;
  const { stage, stageProgress } = session;
  return { share: stageProgress, text: stage ? `${stage} ${percent(stageProgress)}` : 'begins' };
}
