//! Places in a config: which line is wrong, shown as a picture of it.

use std::ops::Range;
use std::path::Path;

use annotate_snippets::{AnnotationKind, Level, Renderer, Snippet};
use espalier_model::diagnose::ParamError;
use toml::de::{DeTable, DeValue};
use toml::{Spanned, Table, Value};

use super::{Config, ConfigError, Override};

/// How far a key may be from a legal one to be taken for it.
const MAX_EDIT_DISTANCE: usize = 3;

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
        self.at(error.span(), first_line(error.message()), suggestion(error.message()))
    }

    /// The error of a value out of range, at `key` in `table` (empty for the top level).
    pub(super) fn value_error(&self, table: &str, error: &ParamError) -> Box<ConfigError> {
        let dotted = if table.is_empty() { error.key.to_owned() } else { format!("{table}.{}", error.key) };
        let title = format!("{dotted}: {}", error.message);
        if let Some(Override { key, value }) = self.overrides.iter().rev().find(|set| set.key == dotted) {
            let rendered = format!("--set {key}={value}: {}", error.message);
            return Box::new(ConfigError { rendered, hint: String::new() });
        }
        self.at(self.find(&dotted), &title, String::new())
    }

    /// The config under overrides.
    pub(super) fn overridden(&self) -> Result<Config, Box<ConfigError>> {
        let mut table: Table = toml::from_str(self.text).map_err(|error| self.parse_error(&error))?;
        for Override { key, value } in self.overrides {
            let in_set = |cause: &str, hint: String| {
                Box::new(ConfigError { rendered: format!("--set {key}={value}: {cause}"), hint })
            };
            lay(&mut table, key, parse_value(value)).map_err(|cause| in_set(&cause, String::new()))?;
            // One at a time, so that the one that is wrong is named.
            Config::deserialize_table(&table)
                .map_err(|error| in_set(first_line(error.message()), suggestion(error.message())))?;
        }
        Config::deserialize_table(&table).map_err(|error| self.parse_error(&error))
    }

    fn at(&self, span: Option<Range<usize>>, title: &str, hint: String) -> Box<ConfigError> {
        let path = self.path.display().to_string();
        let Some(span) = span.filter(|span| span.end <= self.text.len()) else {
            return Box::new(ConfigError { rendered: format!("{path}: {title}"), hint });
        };
        let line = self.text[..span.start].matches('\n').count() + 1;
        let snippet =
            Snippet::source(self.text).path(path.as_str()).annotation(AnnotationKind::Primary.span(span));
        let picture = Renderer::plain().render(&[Level::ERROR.primary_title(title).element(snippet)]);
        let picture = picture.split_once('\n').map_or("", |(_, rest)| rest);
        Box::new(ConfigError { rendered: format!("{path}:{line}: {title}\n{picture}"), hint })
    }

    /// Where a dotted key stands; where the innermost table on the way stands if the key is not there.
    fn find(&self, dotted: &str) -> Option<Range<usize>> {
        let root = DeTable::parse(self.text).ok()?;
        let mut table = root.get_ref();
        let mut place = None;
        let mut names = dotted.split('.').peekable();
        while let Some((name, value)) = names.next().and_then(|name| entry(table, name)) {
            if names.peek().is_none() {
                return Some(name.start..value.span().end);
            }
            place = Some(name);
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

/// Puts `value` at the dotted `key`, making tables on the way.
fn lay(table: &mut Table, key: &str, value: Value) -> Result<(), String> {
    let (tables, last) = key.rsplit_once('.').unwrap_or(("", key));
    if last.is_empty() {
        return Err("the key is empty; write --set stage.key=value".to_owned());
    }
    let mut inner = table;
    for name in tables.split('.').filter(|name| !name.is_empty()) {
        inner = match inner.entry(name).or_insert_with(|| Value::Table(Table::new())) {
            Value::Table(next) => next,
            _ => return Err(format!("{name} is a value, not a table")),
        };
    }
    inner.insert(last.to_owned(), value);
    Ok(())
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

/// The first line; of an unknown name without the list of legal ones, which the hint has.
fn first_line(message: &str) -> &str {
    let line = message.lines().next().unwrap_or_default();
    if line.starts_with("unknown") { line.split(", expected").next().unwrap_or(line) } else { line }
}
