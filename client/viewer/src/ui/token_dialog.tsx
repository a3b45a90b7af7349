import { useEffect, useRef } from 'preact/hooks';
import { hasToken } from '../api/api';
import { giveToken, needsToken } from '../store';

/** Asked when the daemon answers 401. The token is kept until the tab is closed. */
export function TokenDialog() {
  const dialog = useRef<HTMLDialogElement>(null);
  const field = useRef<HTMLInputElement>(null);
  const another = hasToken();
  useEffect(() => {
    dialog.current?.showModal();
    field.current?.focus();
  }, []);
  return (
    <dialog ref={dialog} aria-labelledby="token-title" onClose={() => (needsToken.value = false)}>
      <form
        onSubmit={(event) => {
          event.preventDefault();
          const token = field.current?.value.trim() ?? '';
          if (token) giveToken(token);
        }}
      >
        <h2 id="token-title">Sign in</h2>
        <p>{another ? 'The server does not accept this token. Give another one.' : 'This server asks for a token. Whoever runs it can give you one that may read.'}</p>
        <label for="token">Token</label>
        <input id="token" ref={field} type="password" autocomplete="off" spellcheck={false} required />
        <p class="faint">It stays in this tab and is forgotten when the tab is closed.</p>
        <p><button class="primary" type="submit">Open</button></p>
      </form>
    </dialog>
  );
}
