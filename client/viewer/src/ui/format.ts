// Values as people read them.

const grouped = new Intl.NumberFormat('en-GB');

export const count = (n: number): string => grouped.format(Math.round(n));

/** 1234567 -> 1.23 M */
export function short(n: number): string {
  if (n >= 1e6) return `${(n / 1e6).toFixed(n >= 1e7 ? 1 : 2)} M`;
  if (n >= 1e4) return `${Math.round(n / 1e3)} k`;
  return count(n);
}

export function metres(m: number): string {
  if (m >= 1000) return `${(m / 1000).toFixed(2)} km`;
  if (m >= 100) return `${m.toFixed(1)} m`;
  return m >= 1 ? `${m.toFixed(2)} m` : `${(100 * m).toFixed(1)} cm`;
}

export const percent = (share: number, digits = 0): string => `${(100 * share).toFixed(digits)} %`;

const dateTime = new Intl.DateTimeFormat('en-GB', { dateStyle: 'medium', timeStyle: 'short', timeZone: 'UTC' });

export const time = (seconds: number): string => (seconds > 0 ? `${dateTime.format(new Date(1000 * seconds))} UTC` : '–');

export function duration(seconds: number): string {
  if (seconds < 10) return `${seconds.toFixed(1)} s`;
  if (seconds < 120) return `${Math.round(seconds)} s`;
  return `${Math.floor(seconds / 60)} min ${Math.round(seconds % 60)} s`;
}

export const days = (n: number): string => (n === 1 ? '1 day' : `${count(n)} days`);

const roundSteps = [1, 2, 5];

/** The longest round length, in metres, that fits into so many pixels. */
export function scaleBarLength(metresPerPixel: number, mostPixels: number): number {
  const most = metresPerPixel * mostPixels;
  const decade = 10 ** Math.floor(Math.log10(most));
  return (roundSteps.filter((step) => step * decade <= most).pop() ?? 1) * decade;
}
