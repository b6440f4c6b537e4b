// SPDX-License-Identifier: Apache-2.0
import './styles/page.css';
import { render } from 'preact';
import { openSharedLink } from './api/client';
import { App } from './app';

void openSharedLink().then(() => render(<App />, document.getElementById('app')!));
