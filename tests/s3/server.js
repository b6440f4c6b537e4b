// SPDX-License-Identifier: Apache-2.0
// An S3 server for tests: s3rver with one bucket and the keys S3RVER, S3RVER, over the folder named as argument. Prints
// its address, and ends, and removes the folder, when its standard input does: with the process that started it.
'use strict';

const crypto = require('crypto');
const path = require('path');
const fs = require('fs');
const S3rver = require('s3rver');
const FilesystemStore = require('s3rver/lib/stores/filesystem');

// S3 replaces objects whole; s3rver writes into the old one.
let uploads = 0;
FilesystemStore.prototype.putObject = async function ({ bucket, key, content, metadata }) {
  const chunks = [];
  if (Buffer.isBuffer(content)) chunks.push(content);
  else for await (const chunk of content) chunks.push(chunk);
  const bytes = Buffer.concat(chunks);
  const md5 = crypto.createHash('md5').update(bytes).digest('hex');
  const target = this.getResourcePath(bucket, key, 'object');
  const temporary = this.getResourcePath(bucket, `.upload-${uploads++}`, 'temporary');
  await fs.promises.mkdir(path.dirname(target), { recursive: true });
  await fs.promises.writeFile(temporary, bytes);
  await fs.promises.rename(temporary, target);
  await this.putMetadata(bucket, key, metadata, md5);
  return { size: bytes.length, md5 };
};

// s3rver believes every signature of version 4. This checks them as the documentation of AWS says ("Create a signed AWS
// API request").
function isSigned(request, secret) {
  const [, credential, signedHeaders, signature] =
    /^AWS4-HMAC-SHA256 Credential=(.+?), *SignedHeaders=(.+?), *Signature=(.+)$/.exec(request.headers.authorization) ||
    [];
  if (!signature || !request.headers['x-amz-content-sha256']) return false;
  const [, ...scope] = credential.split('/');
  const names = signedHeaders.split(';');
  if (!names.includes('host') || !names.includes('x-amz-content-sha256')) return false;
  const [target, query = ''] = request.url.split('?');
  const canonical = [
    request.method,
    target,
    query.split('&').sort().join('&'),
    ...names.map((name) => `${name}:${(request.headers[name] || '').trim()}`),
    '',
    signedHeaders,
    request.headers['x-amz-content-sha256'],
  ].join('\n');
  const digest = crypto.createHash('sha256').update(canonical).digest('hex');
  const text = ['AWS4-HMAC-SHA256', request.headers['x-amz-date'], scope.join('/'), digest].join('\n');
  const hmac = (key, data) => crypto.createHmac('sha256', key).update(data).digest();
  const key = scope.reduce(hmac, `AWS4${secret}`);
  return hmac(key, text).toString('hex') === signature;
}

const server = new S3rver({
  address: '127.0.0.1',
  port: 0,
  silent: true,
  vhostBuckets: false,
  directory: process.argv[2],
  configureBuckets: [{ name: 'meshwright' }],
});
server.middleware.unshift(async (context, next) => {
  if (isSigned(context.req, 'S3RVER')) return next();
  context.status = 403;
  context.body = '<Error><Code>SignatureDoesNotMatch</Code><Message>The signature does not match</Message></Error>';
});
server.run().then(({ port }) => console.log(`http://127.0.0.1:${port}`));
process.stdin
  .on('end', () => {
    fs.rmSync(process.argv[2], { recursive: true, force: true });
    process.exit(0);
  })
  .resume();
