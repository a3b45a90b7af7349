// Line icons on a 24 x 24 grid, for the eye only: what carries them has a label.

const paths = {
  home: 'M4 11.5 12 5l8 6.5M6.5 10v9h11v-9',
  above: 'M12 3v11m0 0-4-4m4 4 4-4M4 19h16',
  ruler: 'M3.5 15.5l12-12 5 5-12 12zM7 12l2 2m1-5 2 2m1-5 2 2',
  plus: 'M12 5v14M5 12h14',
  minus: 'M5 12h14',
  help: 'M9.2 9.2a2.9 2.9 0 1 1 4.3 2.6c-.9.5-1.5 1.1-1.5 2.2M12 17.6v.1',
  close: 'M6 6l12 12M18 6 6 18',
  layers: 'M12 4 3 9l9 5 9-5zM4 14l8 4.5 8-4.5',
  play: 'M8 5.5v13l10-6.5z',
  pause: 'M8 6v12M16 6v12',
  chevron: 'M9 6l6 6-6 6',
};

export function Icon({ name }: { name: keyof typeof paths }) {
  return (
    <svg class="icon" viewBox="0 0 24 24" aria-hidden="true" focusable="false">
      <path d={paths[name]} />
    </svg>
  );
}
