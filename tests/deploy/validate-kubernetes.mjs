// SPDX-License-Identifier: Apache-2.0
// Validates what "kubectl kustomize" built: node validate-kubernetes.mjs NAME FILE. Each object against the schema of
// its kind (Kubernetes' and KEDA's, from npm), with unknown fields refused; then what no schema says: selectors that
// select, names that exist, programs that cannot write or become root, drains that fit into grace periods.
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { parseAllDocuments } from "yaml";

const require = createRequire(import.meta.url);
const [name, file] = process.argv.slice(2);
const errors = [];
const objects = parseAllDocuments(readFileSync(file, "utf8")).map((document) => {
  errors.push(...document.errors.map(String));
  return document.toJS();
});
const complain = (object, message) => errors.push(`${object.kind} ${object.metadata?.name}: ${message}`);

function modelOf(object) {
  const [group, version] = object.apiVersion.includes("/") ? object.apiVersion.split("/") : ["", object.apiVersion];
  const path = group.startsWith("keda.") ? `@kubernetes-models/keda/${group}/${version}`
    : `kubernetes-models/${group === "" ? "" : group + "/"}${version}`;
  try {
    return require(path)[object.kind];
  } catch {
    return undefined;
  }
}

function validateSchema(object) {
  const Model = modelOf(object);
  if (Model === undefined) return complain(object, `${object.apiVersion} ${object.kind} is no kind that is known`);
  try {
    new Model(object).validate();
  } catch (error) {
    complain(object, error.message);
  }
}

// The published schemas let unknown fields pass; these are the places where a misspelt one would be missed.
const known = {
  container: ["args", "command", "env", "envFrom", "image", "imagePullPolicy", "livenessProbe", "name", "ports",
    "readinessProbe", "resources", "securityContext", "startupProbe", "volumeMounts"],
  port: ["containerPort", "name", "protocol"],
  env: ["name", "value", "valueFrom"],
  probe: ["failureThreshold", "httpGet", "initialDelaySeconds", "periodSeconds", "timeoutSeconds"],
  deployment: ["replicas", "selector", "strategy", "template"],
  pod: ["automountServiceAccountToken", "containers", "securityContext", "terminationGracePeriodSeconds",
    "restartPolicy", "topologySpreadConstraints", "volumes"],
};
function onlyKnown(object, what, value) {
  for (const field of Object.keys(value ?? {})) {
    if (!known[what].includes(field)) complain(object, `unknown field ${field} of a ${what}`);
  }
}

const named = (kind) => new Set(objects.filter((o) => o.kind === kind).map((o) => o.metadata.name));
const secretsOfTheUser = new Set(["meshwright-postgres", "meshwright-s3", "meshwright-tls", "meshwright-tokens"]);
const templateOf = (object) => (object.kind === "CronJob" ? object.spec.jobTemplate.spec.template : object.spec.template);
const podLabels = objects.filter((o) => ["CronJob", "Deployment", "Job"].includes(o.kind)).map((o) => templateOf(o).metadata.labels);
const selects = (selector) =>
  podLabels.some((labels) => Object.entries(selector ?? {}).every(([key, value]) => labels[key] === value));

function checkProbes(object, container) {
  const ports = new Set(container.ports.map((port) => port.name));
  for (const probe of [container.livenessProbe, container.readinessProbe]) {
    if (!ports.has(probe?.httpGet?.port)) complain(object, `a probe of a port that is not there: ${JSON.stringify(probe)}`);
  }
}

function checkContainer(object, container) {
  onlyKnown(object, "container", container);
  container.ports?.forEach((port) => onlyKnown(object, "port", port));
  for (const probe of ["livenessProbe", "readinessProbe", "startupProbe"]) onlyKnown(object, "probe", container[probe]);
  const security = container.securityContext ?? {};
  if (security.readOnlyRootFilesystem !== true) complain(object, "its root file system can be written");
  if (security.allowPrivilegeEscalation !== false) complain(object, "it may get more rights");
  if (!security.capabilities?.drop?.includes("ALL")) complain(object, "it keeps capabilities");
  if (!container.resources?.requests?.memory || !container.resources?.limits?.memory) complain(object, "no memory said");
  if (["Deployment", "Job"].includes(object.kind)) checkProbes(object, container);
  for (const entry of container.env ?? []) {
    onlyKnown(object, "env", entry);
    const secret = entry.valueFrom?.secretKeyRef;
    if (secret && !secretsOfTheUser.has(secret.name)) complain(object, `secret ${secret.name} is not documented`);
  }
  for (const source of container.envFrom ?? []) {
    const map = source.configMapRef?.name;
    if (map && !named("ConfigMap").has(map)) complain(object, `config map ${map} is not there`);
    const secret = source.secretRef?.name;
    if (secret && !secretsOfTheUser.has(secret)) complain(object, `secret ${secret} is not documented`);
  }
  if (!/:[^:]+$/.test(container.image) || container.image.endsWith(":latest")) complain(object, "its image has no version");
}

function checkPod(object, pod) {
  onlyKnown(object, "pod", pod);
  if (pod.securityContext?.runAsNonRoot !== true) complain(object, "it may run as root");
  if (pod.automountServiceAccountToken !== false) complain(object, "it gets a token that it does not need");
  pod.containers.forEach((container) => checkContainer(object, container));
  const volumes = new Set(pod.volumes.map((volume) => volume.name));
  for (const mount of pod.containers.flatMap((container) => container.volumeMounts)) {
    if (!volumes.has(mount.name)) complain(object, `volume ${mount.name} is not there`);
  }
  for (const volume of pod.volumes) {
    const claim = volume.persistentVolumeClaim?.claimName;
    if (claim && !named("PersistentVolumeClaim").has(claim)) complain(object, `claim ${claim} is not there`);
    const secret = volume.secret?.secretName;
    if (volume.secret && !secretsOfTheUser.has(secret)) complain(object, `secret ${secret} is not documented`);
  }
}

function checkDrain(object, pod) {
  const env = pod.containers.flatMap((container) => container.env ?? []);
  const drain = env.find((entry) => entry.name === "MESHWRIGHT_DRAIN_SECONDS");
  if (drain && pod.terminationGracePeriodSeconds < Number(drain.value) + 15) {
    complain(object, "it is killed before it is drained");
  }
}

function checkDeployment(object) {
  const pod = object.spec.template.spec;
  onlyKnown(object, "deployment", object.spec);
  checkPod(object, pod);
  if (!selects(object.spec.selector.matchLabels)) complain(object, "its selector selects nothing");
  checkDrain(object, pod);
  if (!objects.some((o) => o.kind === "PodDisruptionBudget" &&
      Object.entries(o.spec.selector.matchLabels).every(([k, v]) => object.spec.template.metadata.labels[k] === v))) {
    complain(object, "no disruption budget");
  }
}

// Workers that end by themselves and are begun anew wherever they died.
function checkJob(object) {
  checkPod(object, templateOf(object).spec);
  const { spec } = object;
  if (spec.completionMode !== "Indexed") complain(object, "two of its pods would do the same part");
  if (spec.completions < spec.parallelism) complain(object, "more pods than parts");
  if (!(spec.backoffLimit >= 100)) complain(object, "a few lost nodes end it");
  const env = templateOf(object).spec.containers.flatMap((container) => container.env ?? []);
  if (!env.some((entry) => entry.name === "MESHWRIGHT_EXIT_WHEN_IDLE" && Number(entry.value) > 0)) {
    complain(object, "its workers never end");
  }
  checkDrain(object, templateOf(object).spec);
}

function checkIngress(object) {
  const hosts = new Set(object.spec.tls?.flatMap((tls) => tls.hosts));
  for (const tls of object.spec.tls ?? []) {
    if (!secretsOfTheUser.has(tls.secretName)) complain(object, `secret ${tls.secretName} is not documented`);
  }
  for (const rule of object.spec.rules) {
    if (!hosts.has(rule.host)) complain(object, `${rule.host} is served without TLS`);
    for (const { backend } of rule.http.paths) {
      const service = objects.find((o) => o.kind === "Service" && o.metadata.name === backend.service.name);
      if (!service?.spec.ports.some((port) => port.name === backend.service.port.name)) {
        complain(object, `no service ${backend.service.name} with port ${backend.service.port.name}`);
      }
    }
  }
}

function checkScaling(object) {
  if (!named("Deployment").has(object.spec.scaleTargetRef.name)) complain(object, "it scales what is not there");
  const trigger = object.spec.triggers[0];
  for (const value of Object.values(trigger.metadata)) {
    if (typeof value !== "string") complain(object, "metadata of a trigger are texts");
  }
  const target = objects.find((o) => o.kind === "Deployment" && o.metadata.name === object.spec.scaleTargetRef.name);
  const cores = target?.spec.template.spec.containers[0].resources.requests.cpu;
  if (String(trigger.metadata.threshold) !== String(cores)) complain(object, "the threshold is not a worker's cores");
  if (target?.spec.replicas !== undefined) complain(object, "the deployment would be reset to its own number");
}

for (const object of objects) {
  validateSchema(object);
  if (object.kind !== "Namespace" && object.metadata?.namespace !== "meshwright") complain(object, "another namespace");
  if (object.kind === "Deployment") checkDeployment(object);
  if (object.kind === "Job") checkJob(object);
  if (object.kind === "CronJob") checkPod(object, templateOf(object).spec);
  if (object.kind === "Ingress") checkIngress(object);
  if (object.kind === "ScaledObject") checkScaling(object);
  if (object.kind === "Service" && !selects(object.spec.selector)) complain(object, "its selector selects nothing");
  if (object.kind === "PodDisruptionBudget" && !selects(object.spec.selector?.matchLabels)) {
    complain(object, "its selector selects nothing");
  }
  if (object.kind === "NetworkPolicy" && !selects(object.spec.podSelector?.matchLabels)) {
    complain(object, "its selector selects nothing");
  }
}
for (const kind of ["Deployment", "Service", "PodDisruptionBudget", "NetworkPolicy"]) {
  if (named(kind).size === 0) errors.push(`no ${kind}`);
}
if (named("ScaledObject").size + named("Job").size !== 1) errors.push("workers are neither scaled nor a job, or both");
if (errors.length > 0) {
  console.error(errors.map((error) => `${name}: ${error}`).join("\n"));
  process.exit(1);
}
console.log(`${name}: ${objects.length} objects are valid`);
