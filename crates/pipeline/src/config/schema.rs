//! The config as a JSON Schema, made from the types that parse it.
//!
//! **Input** the types of [`Config`] with their documentation. **Output** a JSON Schema (draft 2020-12): every key with
//! its text, its default, its words or range; no key beside those.
//! **Steps** 1. `schemars` turns the types into a schema. 2. `null` goes, for a key without a value is left out in TOML,
//! and so do the defaults of whole tables. 3. Each number gets the range that `validate()` has ([`super::ranges`]).
//! **Guarantees** one place: a key is declared, documented, given its default and its range where it is parsed.

use schemars::generate::SchemaSettings;
use serde_json::{Map, Value};

use super::Config;
use super::ranges::{self, Range};

/// What an editor shows as the name of the schema.
const TITLE: &str = "espalier config";

/// The schema of a config.
#[must_use]
pub fn schema() -> Value {
    let mut settings = SchemaSettings::draft2020_12();
    settings.inline_subschemas = true;
    let mut schema = settings.into_generator().into_root_schema_for::<Config>().to_value();
    without_null(&mut schema);
    let defaults = ranges::defaults();
    add_ranges(&mut schema, &defaults, "");
    if let Some(root) = schema.as_object_mut() {
        root.insert("title".to_owned(), TITLE.into());
    }
    schema
}

/// The schema as text.
#[must_use]
pub fn schema_text() -> String {
    // A value of JSON: serialisation cannot fail.
    serde_json::to_string_pretty(&schema()).unwrap_or_default() + "\n"
}

/// Takes `null` out of types, choices and defaults, and the defaults of tables, which their keys have.
fn without_null(schema: &mut Value) {
    let Some(schema) = schema.as_object_mut() else { return };
    if let Some(Value::Array(types)) = schema.get_mut("type") {
        types.retain(|name| name != "null");
        if let [only] = types.as_slice() {
            let only = only.clone();
            schema.insert("type".to_owned(), only);
        }
    }
    for key in ["enum", "anyOf", "oneOf"] {
        let Some(Value::Array(choices)) = schema.get_mut(key) else { continue };
        choices.retain(|choice| !choice.is_null() && choice.get("type") != Some(&Value::from("null")));
        choices.iter_mut().for_each(without_null);
        if let (1, true) = (choices.len(), key != "enum") {
            let only = choices.remove(0);
            schema.remove(key);
            inherit(schema, only);
        }
    }
    let is_table = schema.get("default").is_some_and(Value::is_object);
    if is_table || schema.get("default").is_some_and(Value::is_null) {
        schema.remove("default");
    }
    if let Some(Value::Object(properties)) = schema.get_mut("properties") {
        properties.values_mut().for_each(without_null);
    }
    if let Some(items) = schema.get_mut("items") {
        without_null(items);
    }
}

/// Takes over what the only choice says and the key itself does not.
fn inherit(schema: &mut Map<String, Value>, only: Value) {
    let Value::Object(only) = only else { return };
    for (name, value) in only {
        schema.entry(name).or_insert(value);
    }
}

/// Gives every number below `schema` its range, `place` being its dotted key.
fn add_ranges(schema: &mut Value, defaults: &Value, place: &str) {
    let Some(Value::Object(properties)) = schema.get_mut("properties") else { return };
    for (name, inner) in properties {
        let place = if place.is_empty() { name.clone() } else { format!("{place}.{name}") };
        if inner.get("properties").is_some() {
            add_ranges(inner, defaults, &place);
            continue;
        }
        let is_list = inner.get("type") == Some(&Value::from("array"));
        let number = if is_list { inner.get_mut("items") } else { Some(inner) };
        let Some(Value::Object(number)) = number else { continue };
        let kind = number.get("type").and_then(Value::as_str);
        if !matches!(kind, Some("number" | "integer")) {
            continue;
        }
        let is_integer = kind == Some("integer");
        if let Some(range) = ranges::find(defaults, &place, is_integer) {
            insert_range(number, &range, is_integer);
        }
    }
}

fn insert_range(number: &mut Map<String, Value>, range: &Range, is_integer: bool) {
    let written = |bound: f64| if is_integer { Value::from(bound as i64) } else { Value::from(bound) };
    for (bound, closed, open) in
        [(range.least, "minimum", "exclusiveMinimum"), (range.most, "maximum", "exclusiveMaximum")]
    {
        let Some(bound) = bound else { continue };
        number.remove(closed);
        let name = if bound.is_legal { closed } else { open };
        number.insert(name.to_owned(), written(bound.at));
    }
}
