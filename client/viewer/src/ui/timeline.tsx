// The epochs along a line: which one is shown and, on the page of changes, which one it is compared with.

import { useEffect, useState } from 'preact/hooks';
import type { Epoch } from '../api/wire';
import { go, page, route } from '../route';
import { status } from '../stage_state';
import { beforeEpoch, currentEpoch, sessions, timeline } from '../store';
import { time } from './format';
import { Icon } from './icons';

const playPause = 1600; // ms that an epoch stays at least

export function showEpoch(epoch: number): void {
  const newest = timeline.value[timeline.value.length - 1]?.epoch;
  go({ epoch: epoch === newest ? null : epoch });
}

export function step(by: number): void {
  const list = timeline.value;
  const next = list[list.findIndex((e) => e.epoch === currentEpoch.value) + by];
  if (next) showEpoch(next.epoch);
}

export function labelOf(epoch: Epoch): string {
  if (epoch.kind === 'rollback') return `rolled back to ${epoch.baseEpoch}`;
  return epoch.kind === 'empty' ? 'empty' : epoch.session;
}

/** When the session that made an epoch was driven; else when the epoch was made. */
export function timeOf(epoch: Epoch): number {
  const driven = sessions.value?.find((s) => s.id === epoch.session)?.startTime ?? 0;
  return driven || epoch.time;
}

function Slider(props: { label: string; epochs: Epoch[]; value: number; change: (epoch: number) => void; id: string }) {
  const { epochs, value, change } = props;
  const index = Math.max(0, epochs.findIndex((e) => e.epoch === value));
  const at = epochs[index];
  return (
    <div class="slider">
      <label for={props.id}>{props.label}</label>
      <div class="track">
        <div class="ticks" aria-hidden="true">
          {epochs.length <= 60 &&
            epochs.map((e, i) => (
              <i key={e.epoch} class={i <= index ? 'past' : ''} title={e.tags.length > 0 ? `tag ${e.tags.join(', ')}` : undefined} />
            ))}
        </div>
        <input
          id={props.id}
          type="range"
          min={0}
          max={Math.max(epochs.length - 1, 0)}
          step={1}
          value={index}
          disabled={epochs.length < 2}
          aria-valuetext={at ? `Epoch ${at.epoch}, ${labelOf(at)}, ${time(timeOf(at))}` : 'none'}
          onInput={(event) => {
            const chosen = epochs[Number(event.currentTarget.value)];
            if (chosen) change(chosen.epoch);
          }}
        />
      </div>
      <output for={props.id}>
        {at && (
          <>
            <b>Epoch {at.epoch}</b> <span>{labelOf(at)}</span> <span class="faint">{time(timeOf(at))}</span>
            {at.tags.map((tag) => <span class="tag" key={tag}>{tag}</span>)}
          </>
        )}
      </output>
    </div>
  );
}

function usePlaying(): [boolean, (playing: boolean) => void] {
  const [playing, setPlaying] = useState(false);
  useEffect(() => {
    if (!playing) return;
    const timer = window.setInterval(() => {
      if (status.value?.loading) return;
      if (route.value.epoch === null) setPlaying(false);
      else step(1);
    }, playPause);
    return () => window.clearInterval(timer);
  }, [playing]);
  return [playing, setPlaying];
}

export function Timeline() {
  const [playing, setPlaying] = usePlaying();
  const list = timeline.value;
  const current = currentEpoch.value;
  if (current === null || current === 0) return null;
  const before = beforeEpoch.value;
  const comparing = page.value === 'changes';
  const play = () => {
    const first = list[0];
    if (!playing && route.value.epoch === null && first) showEpoch(first.epoch);
    setPlaying(!playing);
  };
  return (
    <section class="timeline" aria-label="Epochs">
      {!comparing && (
        <button class="round" onClick={play} disabled={list.length < 2} aria-label={playing ? 'Stop' : 'Play the epochs one after another'}>
          <Icon name={playing ? 'pause' : 'play'} />
        </button>
      )}
      <div class="sliders">
        {comparing && before !== null && (
          <Slider
            id="before-slider"
            label="Before"
            epochs={list.filter((e) => e.epoch < current)}
            value={before}
            change={(epoch) => go({ from: epoch })}
          />
        )}
        <Slider
          id="epoch-slider"
          label={comparing ? 'After' : 'Epoch'}
          epochs={comparing ? list.slice(1) : list}
          value={current}
          change={showEpoch}
        />
      </div>
      {route.value.epoch !== null && (
        <button class="quiet" onClick={() => go({ epoch: null })}>Newest</button>
      )}
    </section>
  );
}
