#!/usr/bin/env python3
"""deploy_files.py SOURCE METRICS - the files of deploy/ hold together.

METRICS: what `heliod --print-docs metrics` says. Every metric of the rules and of the dashboard is one
of heliod's; promtool accepts the queries, haproxy haproxy.cfg and systemd-analyze the units, where these are
installed (exit code 77 when none is and nothing else is wrong); manifests refer to what they define, and have the
fields of their kinds where python3-kubernetes is installed; the container and the manifests name options that exist.
"""
import copy
import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile

from kubernetes_schema import document_faults

SOURCE, DEPLOY = sys.argv[1], os.path.join(sys.argv[1], "deploy")
METRIC = re.compile(r"\bheliod_[a-z0-9_]+\b")
wrong, ran = [], 0


def text(*path):
    with open(os.path.join(DEPLOY, *path), encoding="utf-8") as f:
        return f.read()


def tool(name, *args, warns=None, **options):
    """Runs a tool when it is there; its complaint, or None. warns: what complaints hold that leave its exit code 0."""
    global ran
    if not shutil.which(name):
        print("not installed: " + name)
        return None
    ran += 1
    done = subprocess.run([name, *args], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                          timeout=60, **options)
    return done.stdout if done.returncode or (warns and warns in done.stdout) else None


def expect(holds, message):
    if not holds:
        wrong.append(message)


def check_metrics():
    with open(sys.argv[2], encoding="utf-8") as f:
        table = f.read()
    known = set(re.findall(r"^\| `(heliod_[a-z0-9_]+)", table, re.M))
    for name in re.findall(r"^\| `(heliod_[a-z0-9_]+)` \| histogram", table, re.M):
        known |= {name + "_bucket", name + "_sum", name + "_count"}
    expect(len(known) > 15, "the table of metrics is empty")
    dashboard = json.loads(text("grafana", "heliod.json"))
    queries = [t["expr"] for p in dashboard["panels"] for t in p["targets"]]
    expect(len({p["id"] for p in dashboard["panels"]}) == len(dashboard["panels"]), "panels share an id")
    for panel in dashboard["panels"]:
        at = panel["gridPos"]
        expect(at["x"] + at["w"] <= 24, "%s: beside the grid" % panel["title"])
    rules = re.sub(r"instance\w*:heliod_[a-z0-9_]+:\w+", "", text("prometheus", "heliod.rules.yml"))
    exprs = re.findall(r"expr: (.*)", rules)
    for name in set(METRIC.findall(" ".join(queries + exprs))):
        expect(name in known, "heliod has no metric " + name)
    with tempfile.TemporaryDirectory() as folder:  # promtool reads the dashboard's queries as rules
        path = os.path.join(folder, "queries.yml")
        rows = [{"record": "q%d:x:y" % i, "expr": q.replace("$instance", ".*")} for i, q in enumerate(queries)]
        with open(path, "w", encoding="utf-8") as f:
            json.dump({"groups": [{"name": "dashboard", "rules": rows}]}, f)
        expect(not (said := tool("promtool", "check", "rules", path)), "dashboard: %s" % said)


def check_tools():
    folder = os.path.join(DEPLOY, "prometheus")
    for args in (["check", "rules", "heliod.rules.yml"], ["check", "config", "prometheus.yml"],
                 ["test", "rules", "heliod.rules.test.yml"]):
        said = tool("promtool", *args, cwd=folder)
        expect(not said, "promtool %s: %s" % (" ".join(args), said))
    env = dict(os.environ, HELIO_ADMIN="/tmp/heliograph-admin.sock")
    said = tool("haproxy", "-c", "-f", os.path.join(DEPLOY, "haproxy", "haproxy.cfg"), env=env)
    expect(not said, "haproxy.cfg: %s" % said)
    # Pods that have no address yet, as before the first of them is there.
    env.update(HELIO_D1="heliod-0.heliod.invalid:7400", HELIO_D2="heliod-1.heliod.invalid:7400")
    said = tool("haproxy", "-c", "-f", os.path.join(DEPLOY, "haproxy", "haproxy.cfg"), env=env)
    expect(not said, "haproxy.cfg with names: %s" % said)


def check_systemd():
    with tempfile.TemporaryDirectory() as folder:
        for name in ("heliod.service", "heliod.socket"):
            with open(os.path.join(folder, name), "w", encoding="utf-8") as f:
                f.write(text("systemd", name).replace("/usr/bin/heliod", "/bin/true"))  # need not be installed
        unit = os.path.join(folder, "heliod.service")
        said = tool("systemd-analyze", "verify", "--man=no", unit, warns="heliod.s")
        expect(not said, "systemd-analyze verify: %s" % said)
        # Exposure in tenths: up to 4.4 is "OK", 2.7 is what namespaces and mounts of the sandbox leave.
        said = tool("systemd-analyze", "security", "--offline=true", "--threshold=30", unit)
        expect(not said, "systemd-analyze security: %s" % (said or "")[-400:])


def option_names():
    with open(os.path.join(SOURCE, "docs", "configuration.md"), encoding="utf-8") as f:
        return set(re.findall(r"^\| `(?:--)?([a-z-]+)", f.read(), re.M))


def check_options():
    known = option_names()
    for path in (("container", "Containerfile"), ("kubernetes", "heliod.yaml")):
        body = text(*path)
        body = body[body.index("ENTRYPOINT"):] if "ENTRYPOINT" in body else body
        for name in re.findall(r"--([a-z][a-z-]+)", re.sub(r'(?m)^#.*$|\["helio".*\]', "", body)):
            expect(name in known, "%s: heliod has no option --%s" % (path[-1], name))


def documents():
    try:
        import yaml
    except ImportError:
        print("not installed: python3-yaml")
        return None
    return [d for d in yaml.safe_load_all(text("kubernetes", "heliod.yaml")) if d]


def check_schema(found):
    if not importlib.util.find_spec("kubernetes"):
        print("not installed: python3-kubernetes")
        return
    for d in found:
        for fault in document_faults(d):
            expect(False, "heliod.yaml: " + fault)
    # It does find faults.
    broken = copy.deepcopy(next(d for d in found if d["kind"] == "StatefulSet"))
    spec = broken["spec"]["template"]["spec"]
    spec["containers"][0]["readynessProbe"] = spec["containers"][0].pop("readinessProbe")
    spec["terminationGracePeriodSeconds"] = "45"
    del broken["spec"]["selector"]
    expect(len(document_faults(broken)) == 3, "three faults are not found: %s" % document_faults(broken))


REQUIRED = {"Service": ("v1", ["ports"]), "StatefulSet": ("apps/v1", ["serviceName", "selector", "template"]),
            "Deployment": ("apps/v1", ["selector", "template"]),
            "PodDisruptionBudget": ("policy/v1", ["selector"]),
            "NetworkPolicy": ("networking.k8s.io/v1", ["podSelector", "policyTypes"])}


def check_pod(name, spec, claims):
    volumes = {v["name"] for v in spec["volumes"]} | claims
    expect(spec["securityContext"]["runAsNonRoot"] is True, name + ": runs as root")
    for c in spec["containers"]:
        ports = {p["name"] for p in c["ports"]}
        expect({m["name"] for m in c["volumeMounts"]} <= volumes, name + ": mounts a volume that is not there")
        expect(c["securityContext"]["capabilities"]["drop"] == ["ALL"], name + ": keeps capabilities")
        for probe in ("startupProbe", "readinessProbe", "livenessProbe"):
            for kind, how in c.get(probe, {}).items():
                if kind == "exec":
                    expect(how["command"][:2] == ["helio", "ping"], "%s: %s is no ping" % (name, probe))
                    continue
                expect(not isinstance(how, dict) or how["port"] in ports, "%s: %s of another port" % (name, probe))
                expect(not isinstance(how, dict) or how.get("path", "/readyz") in ("/readyz", "/healthz"),
                       "%s: %s of another path" % (name, probe))


def check_proxied(found):
    """HAProxy sends the PROXY protocol exactly where the daemons expect it."""
    pods = {d["metadata"]["name"]: d["spec"]["template"]["spec"]["containers"][0] for d in found if "template" in d["spec"]}
    env = {e["name"]: e["value"] for e in pods["haproxy"]["env"]}
    sends = not env.get("HELIO_PROXY", "send-proxy-v2").startswith("no-")
    expects = any(a.startswith("--proxy-from=") for a in pods["heliod"]["args"])
    expect(sends and expects, "the PROXY protocol: sent %s, expected %s" % (sends, expects))
    expect("httpGet" not in json.dumps(pods["heliod"]), "probes without its header are refused")


def check_kubernetes():
    found = documents()
    if found is None:
        return
    check_schema(found)
    check_proxied(found)
    labels, services = {}, {}
    for d in found:
        kind, name, spec = d["kind"], d["metadata"]["name"], d["spec"]
        version, fields = REQUIRED[kind]
        expect(d["apiVersion"] == version, "%s %s: version" % (kind, name))
        expect(all(f in spec for f in fields), "%s %s: lacks one of %s" % (kind, name, fields))
        if "template" in spec:
            labels[name] = spec["template"]["metadata"]["labels"]
            expect(spec["selector"]["matchLabels"] == labels[name], "%s: selects other pods" % name)
            claims = {c["metadata"]["name"] for c in spec.get("volumeClaimTemplates", [])}
            check_pod(name, spec["template"]["spec"], claims)
        if kind == "Service":
            services[name] = spec["selector"]
    for name, selector in services.items():
        expect(selector in labels.values(), "service %s selects no pod" % name)


def main():
    for check in (check_metrics, check_tools, check_systemd, check_options, check_kubernetes):
        check()
    for message in wrong:
        print(message)
    sys.exit(1 if wrong else 0 if ran else 77)


main()
