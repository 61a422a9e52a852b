//! Words of a command line that a user may copy.

use std::path::{Component, Path};

/// A text as one word of a POSIX shell.
pub(crate) fn word(text: &str) -> String {
    let is_plain = text.chars().all(|c| c.is_ascii_alphanumeric() || "._-/=,:+@".contains(c));
    let is_plain = is_plain && !text.starts_with('=') && !text.is_empty();
    if is_plain { text.to_owned() } else { format!("'{}'", text.replace('\'', "'\\''")) }
}

/// A path as a page may show it that is given away: as it was typed, or where that begins at the root or goes upwards, the
/// name alone.
pub(crate) fn shown(path: &Path) -> String {
    let is_plain = path.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    let name = path.file_name().filter(|_| !is_plain);
    name.map_or_else(|| path.to_string_lossy(), |name| name.to_string_lossy()).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_quoted_where_a_shell_needs_it() {
        assert_eq!(word("out/a-1.nii"), "out/a-1.nii");
        assert_eq!(word("embed.w_angle=3"), "embed.w_angle=3");
        assert_eq!(word("a b"), "'a b'");
        assert_eq!(word("it's"), "'it'\\''s'");
        assert_eq!((word(""), word("--set"), word("$HOME")), ("''".into(), "--set".into(), "'$HOME'".into()));
    }

    #[test]
    fn no_folder_above_is_shown() {
        assert_eq!(shown(Path::new("data/samples.tsv")), "data/samples.tsv");
        assert_eq!(shown(Path::new("./out")), "./out");
        assert_eq!(shown(Path::new("/home/jane/samples.tsv")), "samples.tsv");
        assert_eq!(shown(Path::new("../jane/out/")), "out");
    }
}
