//! The keys of a config, each with all that is to be known of it, read from the schema.

use serde::Serialize;
use serde_json::Value;

use super::schema::schema;
use crate::error::Error;

/// Units by the end of a key's name.
const UNITS: [(&str, &str); 10] = [
    ("_mm", "mm"),
    ("_ml", "ml"),
    ("_deg", "degrees"),
    ("_px", "pixels"),
    ("_percent", "%"),
    ("_mib", "MiB"),
    ("_voxels", "voxels"),
    ("_voxel", "voxels"),
    ("_hu", "HU"),
    ("_radii", "radii"),
];

/// How many characters may differ between a key as typed and one that it is taken for.
const MAX_EDIT_DISTANCE: usize = 4;

/// A key of a config.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Key {
    /// Its dotted name, such as `tree.prune_factor`; of an entry of a list `embed.weights[].nodes`.
    pub key: String,
    /// What values it has: `number`, `whole number`, `true or false`, `text`, `one of these`, a list of them.
    pub kind: String,
    /// The unit of its numbers, by its name.
    pub unit: Option<&'static str>,
    /// Its value where none is given, as TOML; none where it then has no value.
    pub default: Option<String>,
    /// The values that its numbers may have, where that hangs on no other key.
    pub range: Option<String>,
    /// The words that it may have, each with its meaning.
    pub choices: Vec<(String, String)>,
    /// What it means.
    pub text: String,
}

/// Every key, in the order of the stages.
#[must_use]
pub fn keys() -> Vec<Key> {
    let mut keys = Vec::new();
    collect(&schema(), "", &mut keys);
    keys
}

/// The key of this name, or all keys of the section of this name.
///
/// # Errors
/// [`Error::UnknownKey`] with the nearest ones.
pub fn explain_keys(name: &str) -> Result<Vec<Key>, Error> {
    let wanted = name.trim().trim_matches(['[', ']']);
    let all = keys();
    let is_meant = |key: &Key| {
        let rest = key.key.strip_prefix(wanted);
        rest.is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
    };
    let found: Vec<Key> = all.iter().filter(|key| is_meant(key)).cloned().collect();
    if found.is_empty() {
        Err(Error::UnknownKey { key: name.to_owned(), nearest: nearest(wanted, &all) })
    } else {
        Ok(found)
    }
}

/// Up to three keys like this one; of those that end as it does, such as `prune_factor`, all come first.
fn nearest(wanted: &str, all: &[Key]) -> Vec<String> {
    let last = |key: &str| key.rsplit('.').next().unwrap_or_default().to_owned();
    let distance = |key: &str| {
        let whole = strsim::damerau_levenshtein(wanted, key);
        whole.min(strsim::damerau_levenshtein(&last(wanted), &last(key)))
    };
    let mut near: Vec<(usize, &str)> = all.iter().map(|key| (distance(&key.key), key.key.as_str())).collect();
    near.retain(|(distance, _)| *distance <= MAX_EDIT_DISTANCE.min(wanted.len() / 2));
    near.sort_unstable();
    near.into_iter().take(3).map(|(_, key)| key.to_owned()).collect()
}

/// Adds the keys below a table of the schema. Tables lie in tables as deep as our types do.
fn collect(table: &Value, place: &str, keys: &mut Vec<Key>) {
    let Some(Value::Object(properties)) = table.get("properties") else { return };
    let (plain, tables): (Vec<_>, Vec<_>) =
        properties.iter().partition(|(_, inner)| inner.get("properties").is_none());
    for (name, inner) in plain {
        let name = dotted(place, name);
        keys.push(key(&name, inner));
        if let Some(entry) = inner.get("items").filter(|items| items.get("properties").is_some()) {
            collect(entry, &format!("{name}[]"), keys);
        }
    }
    for (name, inner) in tables {
        collect(inner, &dotted(place, name), keys);
    }
}

fn dotted(place: &str, name: &str) -> String {
    if place.is_empty() { name.to_owned() } else { format!("{place}.{name}") }
}

fn key(name: &str, schema: &Value) -> Key {
    let of_list = schema.get("items").unwrap_or(schema);
    Key {
        key: name.to_owned(),
        kind: kind(schema),
        unit: UNITS.iter().find(|(end, _)| name.ends_with(end)).map(|(_, unit)| *unit),
        default: schema.get("default").and_then(toml_text),
        range: range(of_list),
        choices: choices(of_list),
        text: one_line(schema.get("description").and_then(Value::as_str).unwrap_or_default()),
    }
}

/// What values a key has, in words.
fn kind(schema: &Value) -> String {
    let options = ["anyOf", "oneOf"].iter().find_map(|name| schema.get(name)).and_then(Value::as_array);
    match schema.get("type").and_then(Value::as_str) {
        Some("array") => {
            let of = schema.get("items").map_or_else(String::new, kind);
            let n_entries = schema.get("minItems").filter(|least| schema.get("maxItems") == Some(*least));
            n_entries.map_or_else(|| format!("list of {of}"), |n| format!("list of {n} times {of}"))
        }
        Some("object") => "table".to_owned(),
        Some("boolean") => "true or false".to_owned(),
        Some("integer") => "whole number".to_owned(),
        Some("number") => "number".to_owned(),
        Some("string") if schema.get("const").is_some() || schema.get("enum").is_some() => "word".to_owned(),
        Some("string") => "text".to_owned(),
        _ => {
            let mut kinds: Vec<String> = options.into_iter().flatten().map(kind).collect();
            if schema.get("const").is_some() || schema.get("enum").is_some() {
                kinds.push("word".to_owned());
            }
            kinds.dedup();
            kinds.join(", or ")
        }
    }
}

/// The words of a key, from wherever they stand in its schema.
fn choices(schema: &Value) -> Vec<(String, String)> {
    let mut found = Vec::new();
    let words = schema.get("enum").and_then(Value::as_array).into_iter().flatten();
    found.extend(
        words
            .chain(schema.get("const"))
            .filter_map(Value::as_str)
            .map(|word| (word.to_owned(), String::new())),
    );
    for option in ["oneOf", "anyOf"].iter().filter_map(|name| schema.get(name)?.as_array()).flatten() {
        let text = one_line(option.get("description").and_then(Value::as_str).unwrap_or_default());
        found.extend(
            choices(option)
                .into_iter()
                .map(|(word, own)| (word, if own.is_empty() { text.clone() } else { own })),
        );
    }
    found
}

fn range(schema: &Value) -> Option<String> {
    let number = |name: &str| schema.get(name).and_then(Value::as_f64);
    let least = number("minimum").map(|least| format!("at least {least}"));
    let above = number("exclusiveMinimum").map(|least| format!("above {least}"));
    let most = number("maximum").map(|most| format!("at most {most}"));
    let below = number("exclusiveMaximum").map(|most| format!("below {most}"));
    let parts: Vec<String> = [least.or(above), most.or(below)].into_iter().flatten().collect();
    (!parts.is_empty()).then(|| parts.join(", "))
}

fn toml_text(value: &Value) -> Option<String> {
    toml::Value::try_from(value).ok().map(|value| value.to_string())
}

/// The text of a doc comment without its line breaks; lists and paragraphs go too.
fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;

    fn one(name: &str) -> Key {
        let mut found = explain_keys(name).expect("a key");
        assert_eq!(found.len(), 1, "{name}");
        found.remove(0)
    }

    #[test]
    fn a_key_has_all_that_is_to_be_known() {
        let key = one("tree.bridge_mm");
        assert_eq!(
            (key.kind.as_str(), key.unit, key.default.as_deref()),
            ("number", Some("mm"), Some("3.0"))
        );
        assert_eq!(key.range.as_deref(), Some("at least 0, at most 1000"));
        assert!(key.text.contains("the widest gap that is bridged"), "{}", key.text);
        let words = one("tree.components").choices;
        assert_eq!(
            words.iter().map(|(word, _)| word.as_str()).collect::<Vec<_>>(),
            ["join", "largest", "all", "refuse"]
        );
        assert!(words[3].1.starts_with("Refuse"), "{words:?}");
        assert_eq!(one("embed.methods").kind, "list of word");
        assert_eq!(one("volume.resample_mm").kind, "word, or number, or list of 3 times number");
        assert_eq!(one("volume.lower").default, None);
    }

    #[test]
    fn sections_and_misspelt_keys() {
        let section = explain_keys("[embed.pso]").expect("a section");
        assert!(section.len() > 5 && section.iter().all(|key| key.key.starts_with("embed.pso.")));
        let Err(Error::UnknownKey { nearest, .. }) = explain_keys("tree.prune_factr") else {
            panic!("a key")
        };
        assert_eq!(nearest[0], "tree.prune_factor");
        let Err(Error::UnknownKey { nearest, .. }) = explain_keys("prune_factor") else { panic!("a key") };
        assert_eq!(nearest[0], "tree.prune_factor");
    }

    /// Each key of the resolved config is one of the schema, and each has a text.
    #[test]
    fn every_key_is_there_and_documented() {
        let all = keys();
        let undocumented: Vec<&str> =
            all.iter().filter(|key| key.text.len() < 15).map(|key| key.key.as_str()).collect();
        assert!(undocumented.is_empty(), "{undocumented:?}");
        let mut tables = vec![(String::new(), toml::Value::try_from(Config::default()).expect("TOML"))];
        let mut n_keys = 0;
        while let Some((place, value)) = tables.pop() {
            if let toml::Value::Table(table) = value {
                tables.extend(table.into_iter().map(|(name, value)| (dotted(&place, &name), value)));
            } else {
                assert!(all.iter().any(|key| key.key == place), "{place}");
                n_keys += 1;
            }
        }
        assert!(n_keys > 100, "{n_keys}");
    }
}
