//! Keys of a config, its schema, and configs to start with, printed.

use espalier_pipeline::Error;
use espalier_pipeline::config::{Key, Template, explain_keys, keys, schema_text};

use crate::args::{ConfigCommand, InitArguments, KeyArguments};
use crate::{explain, progress};

/// Does what the arguments say.
pub(crate) fn execute(command: &ConfigCommand, is_json: bool) -> anyhow::Result<()> {
    match command {
        ConfigCommand::Schema => progress::result(schema_text().trim_end()),
        ConfigCommand::Explain(arguments) => progress::result(&explained(arguments, is_json)?),
        ConfigCommand::Init(arguments) => init(arguments)?,
    }
    Ok(())
}

fn explained(arguments: &KeyArguments, is_json: bool) -> anyhow::Result<String> {
    let found = match &arguments.key {
        Some(name) => explain_keys(name)?,
        None => keys(),
    };
    Ok(match found.as_slice() {
        _ if is_json => serde_json::to_string_pretty(&found)?,
        [key] => page(key),
        found => list(found),
    })
}

fn init(arguments: &InitArguments) -> Result<(), Error> {
    let template = Template::ALL.into_iter().find(|template| template.name() == arguments.kind);
    let template = template.unwrap_or(Template::Airway);
    match &arguments.out {
        None => progress::result(template.text().trim_end()),
        Some(path) => {
            template.write(path)?;
            progress::result(&path.display().to_string());
        }
    }
    Ok(())
}

fn page(key: &Key) -> String {
    let mut lines = vec![key.key.clone(), facts(key), String::new(), explain::paragraph("", &key.text)];
    let width = key.choices.iter().map(|(word, _)| word.chars().count()).max().unwrap_or(0);
    lines.extend((width > 0).then(String::new));
    for (word, text) in &key.choices {
        lines.push(explain::paragraph(&format!("  {word:<width$}  "), text).trim_end().to_owned());
    }
    lines.join("\n")
}

/// Kind, unit, range and default in a line.
fn facts(key: &Key) -> String {
    let unit = key.unit.map(|unit| format!("in {unit}"));
    let default =
        key.default.as_ref().map_or("no default".to_owned(), |default| format!("default {default}"));
    let parts = [Some(key.kind.clone()), unit, key.range.clone(), Some(default)];
    parts.into_iter().flatten().collect::<Vec<_>>().join(", ")
}

fn list(keys: &[Key]) -> String {
    let width = keys.iter().map(|key| key.key.len()).max().unwrap_or(0);
    let mut lines: Vec<String> =
        keys.iter().map(|key| format!("{:<width$}  {}", key.key, facts(key))).collect();
    lines.extend([String::new(), "espalier config explain KEY says what a key means.".to_owned()]);
    lines.join("\n")
}
