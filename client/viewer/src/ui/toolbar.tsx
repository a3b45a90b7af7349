import { asked, helpOpen, measured, tool, view } from '../stage_state';
import { Icon } from './icons';

export function toggleMeasuring(): void {
  measured.value = [];
  asked.value = null;
  tool.value = tool.value === 'measure' ? 'look' : 'measure';
}

export function Toolbar() {
  return (
    <div class="toolbar" role="toolbar" aria-label="View" aria-orientation="vertical">
      <button title="Whole map (H)" aria-label="Whole map" onClick={() => view.value?.home()}><Icon name="home" /></button>
      <button title="From above (T)" aria-label="From above" onClick={() => view.value?.home(true)}><Icon name="above" /></button>
      <button title="Measure (M)" aria-label="Measure a distance" aria-pressed={tool.value === 'measure'} onClick={toggleMeasuring}><Icon name="ruler" /></button>
      <button title="Zoom in (+)" aria-label="Zoom in" onClick={() => view.value?.zoom(0.7)}><Icon name="plus" /></button>
      <button title="Zoom out (-)" aria-label="Zoom out" onClick={() => view.value?.zoom(1 / 0.7)}><Icon name="minus" /></button>
      <button title="Keys (?)" aria-label="Keys and gestures" onClick={() => (helpOpen.value = true)}><Icon name="help" /></button>
    </div>
  );
}
