//! What the parser says of a value, in the words of whoever wrote it.
//!
//! **Input** the message of a parser, such as ``invalid type: string "three", expected f64``. **Output** the same without the
//! names of our types: `found the text "three", expected a number`.
//! **Guarantees** a message of another form is handed on as it is; the texts that our own types give are a user's already.

/// A parser's message as a user may read it: its first line, and of an unknown name without the list of legal ones.
pub(super) fn plain(message: &str) -> String {
    let line = message.lines().next().unwrap_or_default();
    if let Some(rest) = line.strip_prefix("unknown field ") {
        return format!("unknown key {}", without_list(rest));
    }
    if let Some(rest) = line.strip_prefix("unknown variant ") {
        return format!("unknown word {}", without_list(rest));
    }
    if line == "wanted string or table" {
        return "expected a word in quotes".to_owned();
    }
    if let Some(rest) = line.strip_prefix("missing field ") {
        return format!("the key {rest} is missing");
    }
    let kinds = ["invalid type: ", "invalid value: ", "invalid length "];
    let said = kinds
        .iter()
        .find_map(|kind| line.strip_prefix(kind))
        .and_then(|rest| rest.rsplit_once(", expected "));
    match said {
        Some((value, wanted)) => format!("found {}, expected {}", found(value), expected(wanted)),
        None => line.to_owned(),
    }
}

fn without_list(rest: &str) -> &str {
    rest.split(", expected").next().unwrap_or(rest)
}

/// What stands in the config.
fn found(value: &str) -> String {
    let value = value.trim();
    if value.bytes().all(|byte| byte.is_ascii_digit()) && !value.is_empty() {
        return format!("a list of {value}");
    }
    let (kind, rest) = value.split_once(' ').unwrap_or((value, ""));
    let bare = |text: &str| text.replace('`', "");
    match (kind, rest) {
        ("string", text) => format!("the text {text}"),
        ("integer", number) => format!("the number {}", bare(number)),
        ("floating", number) => format!("the number {}", bare(number.trim_start_matches("point "))),
        ("boolean", word) => bare(word),
        ("map", _) => "a table".to_owned(),
        ("sequence", _) => "a list".to_owned(),
        ("unit", _) => "no word".to_owned(),
        _ => value.to_owned(),
    }
}

/// What should stand there.
fn expected(wanted: &str) -> String {
    let length = || wanted.split_whitespace().find(|word| word.bytes().all(|byte| byte.is_ascii_digit()));
    let from_zero = |bits: u32| format!("a whole number from 0 to {}", u64::MAX >> (64 - bits));
    let words = match wanted {
        "f32" | "f64" => "a number",
        "u8" => return from_zero(8),
        "u16" => return from_zero(16),
        "u32" => return from_zero(32),
        "u64" | "usize" => "a whole number from 0 on",
        "i8" | "i16" | "i32" | "i64" | "isize" => "a whole number",
        "a boolean" | "bool" => "true or false",
        "a string" | "string" | "a borrowed string" => "a text in quotes",
        "a sequence" => "a list",
        "a map" | "map" => "a table",
        "string or table" | "string only" => "a word in quotes",
        "fewer elements in array" => "a shorter one",
        _ if wanted.starts_with("struct ") => "a table",
        _ if wanted.starts_with("enum ") => "a word in quotes",
        _ if wanted.starts_with("an array of length") || wanted.starts_with("a tuple of size") => {
            return length().map_or_else(|| "a list".to_owned(), |n| format!("a list of {n}"));
        }
        _ if wanted.ends_with("in sequence") => {
            return length().map_or_else(|| "a list".to_owned(), |n| format!("a list of {n}"));
        }
        own => own,
    };
    words.to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn our_types_are_not_named() {
        for (message, words) in [
            ("invalid type: string \"three\", expected f64", "found the text \"three\", expected a number"),
            (
                "invalid type: floating point `1.5`, expected u32",
                "found the number 1.5, expected a whole number from 0 to 4294967295",
            ),
            (
                "invalid value: integer `-3`, expected u64",
                "found the number -3, expected a whole number from 0 on",
            ),
            ("invalid type: boolean `true`, expected a string", "found true, expected a text in quotes"),
            (
                "invalid type: map, expected \"auto\" or a number",
                "found a table, expected \"auto\" or a number",
            ),
            ("invalid type: integer `3`, expected struct Params", "found the number 3, expected a table"),
            ("invalid length 2, expected an array of length 3", "found a list of 2, expected a list of 3"),
            ("unknown variant `big`, expected one of `a`, `b`", "unknown word `big`"),
            ("unknown field `w_angel`, expected `w_angle`", "unknown key `w_angel`"),
            ("invalid type: unit variant, expected string only", "found no word, expected a word in quotes"),
            ("wanted string or table", "expected a word in quotes"),
            (
                "invalid length 4, expected fewer elements in array",
                "found a list of 4, expected a shorter one",
            ),
            ("missing field `angle_deg`", "the key `angle_deg` is missing"),
            ("invalid basic string\nexpected `\"`", "invalid basic string"),
        ] {
            assert_eq!(plain(message), words);
        }
    }

    /// Whatever the value, commas and quotes of its own do not confuse.
    #[test]
    fn a_text_may_hold_anything() {
        let message = "invalid type: string \"a, expected b\", expected f64";
        assert_eq!(plain(message), "found the text \"a, expected b\", expected a number");
    }
}
