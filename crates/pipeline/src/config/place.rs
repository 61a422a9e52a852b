//! Places in a config: which line is wrong, shown as a picture of it.

use std::ops::Range;
use std::path::Path;

use annotate_snippets::{AnnotationKind, Level, Renderer, Snippet};
use espalier_model::diagnose::ParamError;
use toml::de::{DeTable, DeValue};
use toml::{Spanned, Table, Value};

use super::{COMMAND_LINE, Config, ConfigError, Override, words};

/// How far a key may be from a legal one to be taken for it.
const MAX_EDIT_DISTANCE: usize = 3;
/// The longest line that is shown with its place marked; a longer one would bury the message.
const MAX_SHOWN_LINE: usize = 300;
/// How much of a message is shown: it quotes the text.
const MAX_TITLE: usize = 300;

/// The text of a config and where it stands.
pub(super) struct SourceText<'a> {
    pub(super) text: &'a str,
    pub(super) path: &'a Path,
    /// What the command line lays over it.
    pub(super) overrides: &'a [Override],
}

impl SourceText<'_> {
    /// The error of a text that does not parse.
    pub(super) fn parse_error(&self, error: &toml::de::Error) -> Box<ConfigError> {
        self.at(error.span(), &words::plain(error.message()), suggestion(error.message()))
    }

    /// The error of a value out of range, at `key` in `table` (empty for the top level).
    pub(super) fn value_error(&self, table: &str, error: &ParamError) -> Box<ConfigError> {
        let dotted = if table.is_empty() { error.key.to_string() } else { format!("{table}.{}", error.key) };
        let title = format!("{dotted}: {}", error.message);
        if let Some(Override { key, value }) =
            self.overrides.iter().rev().find(|set| covers(&set.key, &dotted))
        {
            let cause = if *key == dotted { error.message.as_str() } else { title.as_str() };
            let rendered = format!("--set {key}={value}: {cause}");
            return ConfigError::of_set(rendered, String::new());
        }
        self.at(self.find(&dotted), &title, String::new())
    }

    /// The config under overrides.
    pub(super) fn overridden(&self) -> Result<Config, Box<ConfigError>> {
        let mut table: Table = toml::from_str(self.text).map_err(|error| self.parse_error(&error))?;
        for Override { key, value } in self.overrides {
            let in_set = |cause: &str, hint: String| {
                ConfigError::of_set(format!("--set {key}={value}: {cause}"), hint)
            };
            lay(&mut table, key, parse_value(value)).map_err(|cause| in_set(&cause, String::new()))?;
            // One at a time, so that the one that is wrong is named.
            Config::deserialize_table(&table)
                .map_err(|error| in_set(&words::plain(error.message()), suggestion(error.message())))?;
        }
        Config::deserialize_table(&table).map_err(|error| self.parse_error(&error))
    }

    /// Whether the text or the command line has a value at a dotted key.
    pub(super) fn sets(&self, dotted: &str) -> bool {
        let mut value = toml::from_str::<Table>(self.text).ok().map(Value::Table);
        for name in dotted.split('.') {
            value = value.and_then(|value| value.get(name).cloned());
        }
        value.is_some() || self.overrides.iter().any(|set| covers(&set.key, dotted))
    }

    fn at(&self, span: Option<Range<usize>>, title: &str, hint: String) -> Box<ConfigError> {
        let path = self.path.display().to_string();
        let file = (path != COMMAND_LINE).then(|| self.path.to_owned());
        let title: String = title.chars().take(MAX_TITLE).collect();
        let Some(span) = span.filter(|span| span.end <= self.text.len()) else {
            return Box::new(ConfigError { rendered: format!("{path}: {title}"), hint, file, line: None });
        };
        let line = self.text[..span.start].matches('\n').count() + 1;
        if span.len() > MAX_SHOWN_LINE || self.longest_line_at(&span) > MAX_SHOWN_LINE {
            let rendered = format!("{path}:{line}: {title}");
            return Box::new(ConfigError { rendered, hint, file, line: Some(line) });
        }
        let snippet =
            Snippet::source(self.text).path(path.as_str()).annotation(AnnotationKind::Primary.span(span));
        let picture =
            Renderer::plain().render(&[Level::ERROR.primary_title(title.as_str()).element(snippet)]);
        let picture = picture.split_once('\n').map_or("", |(_, rest)| rest);
        let rendered = format!("{path}:{line}: {title}\n{picture}");
        Box::new(ConfigError { rendered, hint, file, line: Some(line) })
    }

    /// The bytes of the longest line from that before a place to that after it.
    fn longest_line_at(&self, span: &Range<usize>) -> usize {
        let (before, after) = (&self.text[..span.start], &self.text[span.end..]);
        let at = before.lines().next_back().map_or(0, str::len)
            + span.len()
            + after.lines().next().map_or(0, str::len);
        let rest = before.lines().rev().skip(1).take(1).chain(after.lines().skip(1).take(1));
        rest.map(str::len).max().unwrap_or(0).max(at)
    }

    /// Where a dotted key stands; where the innermost table on the way stands if the key is not there.
    fn find(&self, dotted: &str) -> Option<Range<usize>> {
        let root = DeTable::parse(self.text).ok()?;
        let mut table = root.get_ref();
        let mut place = None;
        let mut names = dotted.split('.').peekable();
        while let Some(step) = names.next() {
            let (name, idx) = with_index(step);
            let Some((name, mut value)) = entry(table, name) else { break };
            let mut span = name.start..value.span().end;
            place = Some(name);
            if let (Some(idx), DeValue::Array(list)) = (idx, value.get_ref()) {
                let Some(item) = list.get(idx) else { break };
                (value, span) = (item, item.span());
                place = Some(item.span());
            }
            if names.peek().is_none() {
                return Some(span);
            }
            match value.get_ref() {
                DeValue::Table(inner) => table = inner,
                _ => break,
            }
        }
        place
    }
}

impl Config {
    fn deserialize_table(table: &Table) -> Result<Self, toml::de::Error> {
        serde::Deserialize::deserialize(Value::Table(table.clone()))
    }
}

fn entry<'t, 'i>(table: &'t DeTable<'i>, key: &str) -> Option<(Range<usize>, &'t Spanned<DeValue<'i>>)> {
    table.iter().find(|(name, _)| name.get_ref() == key).map(|(name, value)| (name.span(), value))
}

/// Whether what `--set` lays at `key` reaches the value at `dotted`: the very key, or one that it lies in.
fn covers(key: &str, dotted: &str) -> bool {
    dotted.strip_prefix(key).is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
}

/// A step of a dotted key and its place in a list: `weights[2]` is the third of `weights`.
fn with_index(step: &str) -> (&str, Option<usize>) {
    step.strip_suffix(']')
        .and_then(|open| open.split_once('['))
        .and_then(|(name, idx)| Some((name, Some(idx.parse().ok()?))))
        .unwrap_or((step, None))
}

/// Puts `value` at the dotted `key`, making tables on the way; `[i]` chooses from a list, or adds to its end.
fn lay(table: &mut Table, key: &str, value: Value) -> Result<(), String> {
    let (tables, last) = key.rsplit_once('.').unwrap_or(("", key));
    if last.is_empty() {
        return Err("the key is empty; write --set stage.key=value".to_owned());
    }
    let mut inner = table;
    for step in tables.split('.').filter(|step| !step.is_empty()) {
        inner = match slot(inner, step, Value::Table(Table::new()))? {
            Value::Table(next) => next,
            _ => return Err(format!("{step} is a value, not a table")),
        };
    }
    *slot(inner, last, Value::Boolean(false))? = value;
    Ok(())
}

/// The value at a step, `empty` if there is none yet.
fn slot<'t>(table: &'t mut Table, step: &str, empty: Value) -> Result<&'t mut Value, String> {
    let (name, Some(idx)) = with_index(step) else {
        return Ok(table.entry(step).or_insert(empty));
    };
    let Value::Array(list) = table.entry(name).or_insert_with(|| Value::Array(Vec::new())) else {
        return Err(format!("{name} is no list"));
    };
    let n_items = list.len();
    if idx == n_items {
        list.push(empty);
    }
    list.get_mut(idx).ok_or_else(|| format!("{name} has {n_items} entries, the next is {name}[{n_items}]"))
}

/// A value as TOML; what is not TOML is a string, so that `--set embed.method=radial` needs no quotes.
fn parse_value(text: &str) -> Value {
    toml::from_str::<Table>(&format!("value = {text}"))
        .ok()
        .filter(|table| table.len() == 1)
        .and_then(|mut table| table.remove("value"))
        .unwrap_or_else(|| Value::from(text))
}

/// The way out of "unknown field `x`, expected one of `a`, `b`": the nearest name and all of them.
fn suggestion(message: &str) -> String {
    let mut quoted = message.split('`').skip(1).step_by(2);
    let is_choice = message.starts_with("unknown field") || message.starts_with("unknown variant");
    let (true, Some(found)) = (is_choice, quoted.next()) else { return String::new() };
    let legal: Vec<&str> = quoted.collect();
    let nearest = legal
        .iter()
        .map(|name| (strsim::damerau_levenshtein(found, name), *name))
        .min()
        .filter(|(distance, _)| *distance <= MAX_EDIT_DISTANCE);
    let legal = legal.join(", ");
    nearest.map_or_else(
        || format!("legal here: {legal}"),
        |(_, name)| format!("did you mean {name}? legal here: {legal}"),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;

    const TEXT: &str = "schema = 1
[input]
phantom = \"neuron\"
[[embed.weights]]
generations = [0, 2]
w_length = 10
[[embed.weights]]
branches = [3, 7]
w_angle = -1
";

    fn parse(text: &str, sets: &[(&str, &str)]) -> Result<Config, String> {
        let set =
            |(key, value): &(&str, &str)| Override { key: (*key).to_owned(), value: (*value).to_owned() };
        let overrides: Vec<Override> = sets.iter().map(set).collect();
        Config::parse(text, Path::new("a.toml"), &overrides).map_err(|error| error.to_string())
    }

    #[track_caller]
    fn refused(text: &str, sets: &[(&str, &str)], fragments: &[&str]) {
        let error = parse(text, sets).expect_err("refused");
        for fragment in fragments {
            assert!(error.contains(fragment), "no {fragment:?} in: {error}");
        }
    }

    #[test]
    fn a_list_entry_is_found_at_its_line() {
        refused(TEXT, &[], &["a.toml:9: embed.weights[1].w_angle: must be from 0 to 1e6, is -1"]);
        let no_weight = TEXT.replace("w_angle = -1\n", "");
        refused(&no_weight, &[], &["a.toml:7: embed.weights[1]: says no weight"]);
        let typo = TEXT.replace("w_angle", "w_angel");
        refused(&typo, &[], &["a.toml:9: unknown key `w_angel`"]);
        let inverted = TEXT.replace("[0, 2]", "[2, 0]").replace("-1", "1");
        refused(&inverted, &[], &["a.toml:5: embed.weights[0].generations", "is [2, 0]"]);
        let nowhere = TEXT.replace("branches = [3, 7]\n", "").replace("-1", "1");
        refused(&nowhere, &[], &["a.toml:7: embed.weights[1]: says not where"]);
    }

    #[test]
    fn a_list_entry_can_be_set() {
        let config = parse(&TEXT.replace("-1", "1"), &[("embed.weights[1].w_angle", "4")]).expect("a config");
        assert_eq!(config.embed.weights[1].w_angle, Some(4.0));
        assert_eq!(config.embed.weights[0].w_length, Some(10.0));
        // Written out and read again, it is the same config.
        assert_eq!(parse(&config.to_toml(), &[]), Ok(config));
        let text = "schema = 1\n[input]\nphantom = \"neuron\"\n";
        let whole = [
            ("embed.weights", "[{ nodes = [4], w_length = 3.0 }]"),
            ("embed.weights[1]", "{ nodes = [5], w_angle = 1 }"),
        ];
        let config = parse(text, &whole).expect("a config");
        assert_eq!(config.embed.weights.len(), 2);
        assert_eq!(config.embed.weights[1].nodes, Some(vec![5]));
    }

    #[test]
    fn what_cannot_be_set_is_named() {
        let text = "schema = 1\n[input]\nphantom = \"neuron\"\n";
        refused(
            text,
            &[("embed.weights", "[{ nodes = [4], w_length = -3 }]")],
            &["--set embed.weights=", "embed.weights[0].w_length: must be from 0 to 1e6"],
        );
        refused(
            text,
            &[("embed.weights[4].w_angle", "1")],
            &["--set embed.weights[4].w_angle=1: weights has 0 entries"],
        );
        refused(text, &[("embed.method[0]", "1")], &["--set embed.method[0]=1"]);
        refused(TEXT, &[], &["embed.weights[1].w_angle"]);
        refused(
            &TEXT.replace("-1", "1"),
            &[("embed.weights[1].w_angle", "-2")],
            &["--set embed.weights[1].w_angle=-2: must be"],
        );
    }
}
