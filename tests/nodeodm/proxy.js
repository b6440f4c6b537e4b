// SPDX-License-Identifier: Apache-2.0
// Forwards everything to TARGET, bodies unchanged and the token replaced, as ClusterODM does. Prints its port.
// Usage: proxy.js TARGET TOKEN
const http = require('node:http');
const httpProxy = require('http-proxy');

const [target, token] = process.argv.slice(2);
const proxy = httpProxy.createProxyServer({ target, proxyTimeout: 30_000 });
proxy.on('error', (_error, _request, response) => response.destroy());
const server = http.createServer((request, response) => {
  const url = new URL(request.url, 'http://proxy');
  if (url.searchParams.get('token') === 'of-the-proxy') url.searchParams.set('token', token);
  request.url = url.pathname + url.search;
  proxy.web(request, response);
});
server.listen(0, '127.0.0.1', () => console.log(server.address().port));
