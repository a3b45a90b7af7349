import { render } from 'preact';
import { App } from './ui/app';
import './style/base.css';
import './style/layout.css';
import './style/parts.css';

const root = document.getElementById('app');
if (root) render(<App />, root);
