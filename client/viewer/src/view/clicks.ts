// Clicks and taps on a canvas whose drags move a camera.

const mostPixels = 6;

/**
 * Calls back for one finger or the left button, put down and lifted in place; x and y in pixels of the element. How long
 * it was held says nothing: where the processor draws, both events may wait for a frame.
 */
export function listenForClicks(
  element: HTMLElement,
  clicked: (x: number, y: number, touch: boolean) => void,
): void {
  let down: { x: number; y: number; id: number } | null = null;
  let fingers = 0;
  element.addEventListener('pointerdown', (event) => {
    ++fingers;
    down =
      fingers === 1 && event.button === 0
        ? { x: event.offsetX, y: event.offsetY, id: event.pointerId }
        : null;
  });
  const lift = () => (fingers = Math.max(0, fingers - 1));
  element.addEventListener('pointercancel', lift);
  element.addEventListener('pointerup', (event) => {
    lift();
    if (!down || down.id !== event.pointerId) return;
    const moved = Math.hypot(event.offsetX - down.x, event.offsetY - down.y);
    down = null;
    if (moved <= mostPixels) clicked(event.offsetX, event.offsetY, event.pointerType === 'touch');
  });
}
