// The address of the page, and how to go to another.

import { computed, signal } from '@preact/signals';
import { hashOf, parseRoute, type Route } from './address';

export const route = signal<Route>(parseRoute(location.hash));

// Each changes only when its own part of the address does.
export const mapName = computed(() => route.value.map);
export const page = computed(() => route.value.page);
export const colour = computed(() => route.value.colour);

window.addEventListener('hashchange', () => {
  route.value = parseRoute(location.hash);
});

/** Another page makes an entry in the browser's history, another epoch or colour does not. */
export function go(change: Partial<Route>): void {
  const next = { ...route.value, ...change };
  const step = next.map !== route.value.map || next.page !== route.value.page;
  route.value = next;
  history[step ? 'pushState' : 'replaceState'](null, '', hashOf(next));
}

window.addEventListener('popstate', () => {
  route.value = parseRoute(location.hash);
});
