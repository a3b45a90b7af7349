// What changed between two epochs, and from each epoch to the next.

import { useEffect, useState } from 'preact/hooks';
import { countChanges } from '../api/api';
import type { Changes, Epoch } from '../api/wire';
import { go, mapName } from '../route';
import { changes, classesShown } from '../stage_state';
import { beforeEpoch, currentEpoch, map, timeline } from '../store';
import { changeColours } from '../view/ramps';
import { count, short } from './format';
import { labelOf } from './timeline';

type Kind = keyof typeof changeColours;

const kinds: { kind: Kind; name: string; meaning: string }[] = [
  { kind: 'appeared', name: 'Appeared', meaning: 'stands now and did not before' },
  { kind: 'disappeared', name: 'Disappeared', meaning: 'stood before and does not now' },
  { kind: 'unstable', name: 'Unstable', meaning: 'still there, but seen less and less' },
];

export function ChangesPanel() {
  const before = beforeEpoch.value;
  const after = currentEpoch.value;
  if (map.value && before === null) {
    return (
      <section class="empty">
        <h2>Nothing to compare yet</h2>
        <p>Changes need two epochs. The next session that is merged makes one more.</p>
      </section>
    );
  }
  const now = changes.value;
  const cubic = (map.value?.voxelSize ?? 0) ** 3;
  return (
    <>
      <section>
        <h2>From epoch {before} to {after}</h2>
        {now?.state === 'failed' && <p class="error" role="alert">{now.message}</p>}
        <ul class="kinds" aria-busy={now?.state === 'loading'}>
          {kinds.map(({ kind, name, meaning }) => {
            const n = now?.state === 'ready' ? now.counts[kind] : null;
            return (
              <li key={kind}>
                <label>
                  <input
                    type="checkbox"
                    checked={classesShown.value[kind]}
                    onChange={(event) => (classesShown.value = { ...classesShown.value, [kind]: event.currentTarget.checked })}
                  />
                  <i style={{ background: changeColours[kind] }} />
                  <span class="name">{name}</span>
                  <b>{n === null ? '…' : count(n)}</b>
                  <span class="faint">{meaning}{n ? ` · ${(n * cubic).toFixed(1)} m³` : ''}</span>
                </label>
              </li>
            );
          })}
        </ul>
        <p class="faint">In voxels of {Math.round(100 * (map.value?.voxelSize ?? 0))} cm. The rest of the map steps back.</p>
      </section>
      <History />
    </>
  );
}

const mostSteps = 12;

/** The newest steps from epoch to epoch, asked for one after the other. */
function History() {
  const list = timeline.value.slice(-mostSteps - 1);
  const key = `${mapName.value}/${list.map((e) => e.epoch).join(',')}`;
  const [known, setKnown] = useState<Record<string, Changes>>({});
  useEffect(() => {
    const name = mapName.value;
    if (!name) return;
    let wanted = true;
    void (async () => {
      for (let i = list.length - 1; i > 0 && wanted; --i) {
        const before = list[i - 1]?.epoch ?? 0;
        const after = list[i]?.epoch ?? 0;
        try {
          const counts = await countChanges(name, before, after);
          if (wanted) setKnown((old) => ({ ...old, [`${before}-${after}`]: counts }));
        } catch {
          return; // the panel above says what is wrong
        }
      }
    })();
    return () => {
      wanted = false;
    };
  }, [key]);
  if (list.length < 2) return null;
  const steps = list.slice(1).map((after, i) => ({ before: list[i] as Epoch, after }));
  const most = Math.max(1, ...Object.values(known).map((c) => Math.max(c.appeared, c.disappeared)));
  return (
    <section>
      <h2>Step by step</h2>
      <ol class="steps" reversed>
        {steps.reverse().map(({ before, after }) => {
          const counts = known[`${before.epoch}-${after.epoch}`];
          const shown = after.epoch === currentEpoch.value && before.epoch === beforeEpoch.value;
          return (
            <li key={after.epoch}>
              <button aria-pressed={shown} onClick={() => go({ epoch: after.epoch, from: before.epoch })}>
                <span class="name">{before.epoch} → {after.epoch} <span class="faint">{labelOf(after)}</span></span>
                <span class="bars" aria-hidden="true">
                  <i style={{ width: `${(100 * (counts?.disappeared ?? 0)) / most}%`, background: changeColours.disappeared }} />
                  <i style={{ width: `${(100 * (counts?.appeared ?? 0)) / most}%`, background: changeColours.appeared }} />
                </span>
                <span class="faint">
                  {counts ? `${short(counts.appeared)} appeared, ${short(counts.disappeared)} disappeared` : 'counting…'}
                </span>
              </button>
            </li>
          );
        })}
      </ol>
    </section>
  );
}
