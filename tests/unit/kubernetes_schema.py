"""Kubernetes' own description of its objects (the models of the Python client, Debian's python3-kubernetes), held
against a manifest: no field that the kind does not have, none of another type, none missing."""
import re

PLAIN = {"str": str, "int": int, "bool": bool, "float": (int, float)}


def faults(value, type_name, at):
    """Yields what is wrong with a value of a manifest that is to be of a type."""
    from kubernetes.client import models
    inner = re.fullmatch(r"(list\[|dict\(str, )(.*)[\])]", type_name)
    if type_name in ("object", "datetime"):
        return
    if type_name in PLAIN:
        if not isinstance(value, PLAIN[type_name]) or (isinstance(value, bool) and type_name != "bool"):
            yield f"{at}: {value!r} is no {type_name}"
        return
    if not isinstance(value, list if type_name.startswith("list[") else dict):
        yield f"{at}: {value!r} is no {type_name}"
        return
    if inner:
        for name, item in enumerate(value) if isinstance(value, list) else value.items():
            yield from faults(item, inner[2], f"{at}/{name}")
        return
    model = getattr(models, type_name)
    attributes = {key: name for name, key in model.attribute_map.items()}
    for key, item in value.items():
        if key not in attributes:
            yield f"{at}/{key}: {type_name} has no such field"
        else:
            yield from faults(item, model.openapi_types[attributes[key]], f"{at}/{key}")
    try:
        model(**{attributes[key]: item for key, item in value.items() if key in attributes})
    except ValueError as said:
        yield f"{at}: {said}"


def document_faults(document):
    """Of one document: `apps/v1` and `StatefulSet` are the model V1StatefulSet."""
    from kubernetes.client import models
    kind, version = document["kind"], document["apiVersion"].split("/")[-1]
    name = version.capitalize() + kind
    if not hasattr(models, name):
        return [f"{kind}: no such kind in {document['apiVersion']}"]
    return list(faults(document, name, f"{kind} {document['metadata']['name']}"))
