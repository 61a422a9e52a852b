//! A JSON value held against a JSON Schema, as far as our schemas go: a word of theirs that is not known here fails.
#![allow(dead_code, reason = "each test takes what it needs")]

use serde_json::Value;

/// Words that say nothing of what is legal.
const REMARKS: [&str; 6] = ["$schema", "title", "description", "default", "format", "$defs"];

/// What is wrong with a value, each with its place; nothing if it is legal.
pub(crate) fn faults(schema: &Value, value: &Value) -> Vec<String> {
    let mut found = Vec::new();
    check(schema, value, "", &mut found);
    found
}

fn check(schema: &Value, value: &Value, place: &str, found: &mut Vec<String>) {
    let Value::Object(words) = schema else { return };
    for (word, of) in words {
        let is_legal = match word.as_str() {
            "type" => is_of_type(of, value),
            "const" => of == value,
            "enum" => of.as_array().is_some_and(|words| words.contains(value)),
            "minimum" => compare(value, of, |value, bound| value >= bound),
            "maximum" => compare(value, of, |value, bound| value <= bound),
            "exclusiveMinimum" => compare(value, of, |value, bound| value > bound),
            "exclusiveMaximum" => compare(value, of, |value, bound| value < bound),
            "minItems" => value.as_array().is_none_or(|list| list.len() as u64 >= of.as_u64().unwrap_or(0)),
            "maxItems" => value.as_array().is_none_or(|list| list.len() as u64 <= of.as_u64().unwrap_or(0)),
            "anyOf" | "oneOf" => {
                let options = of.as_array().map(Vec::as_slice).unwrap_or_default();
                let n_fitting = options.iter().filter(|option| faults(option, value).is_empty()).count();
                if word == "anyOf" { n_fitting > 0 } else { n_fitting == 1 }
            }
            "required" => of
                .as_array()
                .into_iter()
                .flatten()
                .all(|name| value.get(name.as_str().unwrap_or_default()).is_some()),
            "items" => {
                for (index, item) in value.as_array().into_iter().flatten().enumerate() {
                    check(of, item, &format!("{place}[{index}]"), found);
                }
                true
            }
            "properties" => {
                for (name, inner) in value.as_object().into_iter().flatten() {
                    if let Some(of) = of.get(name) {
                        check(of, inner, &format!("{place}.{name}"), found);
                    }
                }
                true
            }
            "additionalProperties" => {
                let known = words.get("properties");
                let is_known = |name: &String| known.is_some_and(|known| known.get(name).is_some());
                of != &Value::Bool(false) || value.as_object().is_none_or(|table| table.keys().all(is_known))
            }
            remark => REMARKS.contains(&remark),
        };
        if !is_legal {
            found.push(format!("{place}: {word} {of}: {value}"));
        }
    }
}

fn is_of_type(of: &Value, value: &Value) -> bool {
    let is = |name: &str| match name {
        "null" => value.is_null(),
        "boolean" => value.is_boolean(),
        "string" => value.is_string(),
        "integer" => value.is_i64() || value.is_u64(),
        "number" => value.is_number(),
        "array" => value.is_array(),
        "object" => value.is_object(),
        _ => false,
    };
    match of {
        Value::String(name) => is(name),
        Value::Array(names) => names.iter().filter_map(Value::as_str).any(is),
        _ => false,
    }
}

fn compare(value: &Value, bound: &Value, holds: impl Fn(f64, f64) -> bool) -> bool {
    match (value.as_f64(), bound.as_f64()) {
        (Some(value), Some(bound)) => holds(value, bound),
        _ => true,
    }
}
