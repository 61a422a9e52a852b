//! The sources of the workspace as tokens, program and tests apart.
//!
//! Comments are no tokens, and doc comments, which are attributes, are left out: what counts is code.

use std::path::{Path, PathBuf};

use proc_macro2::{Delimiter, TokenStream, TokenTree};

/// One file, or the tests at its end.
pub(crate) struct Source {
    /// The crate's folder, such as `volume`.
    pub(crate) crate_name: String,
    pub(crate) path: PathBuf,
    pub(crate) text: String,
    /// String literals without their quotes.
    strings: Vec<String>,
    /// Identifiers in order.
    names: Vec<String>,
}

/// All sources.
pub(crate) struct Sources {
    pub(crate) program: Vec<Source>,
    tests: Vec<Source>,
}

/// The enum and the variant of an error, and the crate that it is of.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Variant {
    pub(crate) crate_name: String,
    pub(crate) of: String,
    pub(crate) name: String,
}

impl Sources {
    pub(crate) fn read() -> Self {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the workspace");
        let (mut program, mut tests) = (Vec::new(), Vec::new());
        let mut files = Vec::new();
        rust_files(&root.join("crates"), &mut files);
        rust_files(&root.join("tests/tests"), &mut files);
        // This test names codes that it does not raise.
        files.retain(|path| !path.starts_with(root.join("tests/tests/codes")));
        for path in files {
            let text = std::fs::read_to_string(&path).expect("a source");
            let tokens: TokenStream = text.parse().expect("tokens");
            let in_crates = path.strip_prefix(root.join("crates")).ok();
            let crate_name = in_crates
                .and_then(|path| path.iter().next())
                .map_or("", |name| name.to_str().expect("a name"));
            let new = |tokens: Vec<TokenTree>| {
                let mut source = Source {
                    crate_name: crate_name.to_owned(),
                    path: path.clone(),
                    text: text.clone(),
                    strings: Vec::new(),
                    names: Vec::new(),
                };
                source.take(tokens);
                source
            };
            let is_test = in_crates.is_none()
                || path.components().any(|part| part.as_os_str() == "tests")
                || path.file_name().is_some_and(|name| name == "tests.rs");
            let (code, test_modules) =
                if is_test { (Vec::new(), tokens.into_iter().collect()) } else { apart(tokens) };
            program.extend((!code.is_empty()).then(|| new(code)));
            tests.extend((!test_modules.is_empty()).then(|| new(test_modules)));
        }
        Self { program, tests }
    }

    /// Every code that the program can give.
    pub(crate) fn given(&self) -> impl Iterator<Item = &str> {
        self.program
            .iter()
            .flat_map(|source| &source.strings)
            .map(String::as_str)
            .filter(|text| is_code(text))
    }

    pub(crate) fn tests_with_code(&self, code: &str) -> Vec<String> {
        let has = |source: &Source| source.strings.iter().any(|text| holds(text, code));
        self.tests.iter().filter(|source| has(source)).map(Source::name).collect()
    }

    pub(crate) fn tests_with_variant(&self, variant: &Variant) -> Vec<String> {
        let has = |source: &Source| {
            let path = [variant.of.as_str(), variant.name.as_str()];
            let is_of_crate = variant.of != "Error" || source.crate_name == variant.crate_name;
            is_of_crate && source.names.windows(2).any(|names| names == path)
        };
        self.tests.iter().filter(|source| has(source)).map(Source::name).collect()
    }
}

impl Source {
    fn name(&self) -> String {
        self.path.display().to_string()
    }

    fn take(&mut self, tokens: Vec<TokenTree>) {
        let mut lists = vec![tokens.into_iter().peekable()];
        while let Some(list) = lists.last_mut() {
            match list.next() {
                None => drop(lists.pop()),
                Some(TokenTree::Punct(sign)) if sign.as_char() == '#' => {
                    list.next_if(|next| matches!(next, TokenTree::Punct(sign) if sign.as_char() == '!'));
                    list.next_if(is_bracketed);
                }
                Some(TokenTree::Group(group)) => {
                    lists.push(group.stream().into_iter().collect::<Vec<_>>().into_iter().peekable());
                }
                Some(TokenTree::Literal(literal)) => self.strings.extend(quoted(&literal.to_string())),
                Some(TokenTree::Ident(name)) => self.names.push(name.to_string()),
                Some(TokenTree::Punct(_)) => {}
            }
        }
    }
}

/// What stands between the quotes of a literal.
fn quoted(literal: &str) -> Option<String> {
    let (begin, end) = (literal.find('"')?, literal.rfind('"')?);
    literal.get(begin + 1..end).map(str::to_owned)
}

fn is_bracketed(token: &TokenTree) -> bool {
    matches!(token, TokenTree::Group(group) if group.delimiter() == Delimiter::Bracket)
}

/// What a file has for the program, and what stands behind `#[cfg(test)]`.
fn apart(tokens: TokenStream) -> (Vec<TokenTree>, Vec<TokenTree>) {
    let all: Vec<TokenTree> = tokens.into_iter().collect();
    let is_cfg_test =
        |token: &TokenTree| is_bracketed(token) && token.to_string().replace(' ', "") == "[cfg(test)]";
    let begins = all.iter().position(is_cfg_test).unwrap_or(all.len());
    // `mod tests;` is a file of its own, and code follows.
    let is_declared = all.get(begins + 3).is_some_and(|token| token.to_string() == ";");
    if is_declared { (all, Vec::new()) } else { (all[..begins].to_vec(), all[begins..].to_vec()) }
}

fn is_code(text: &str) -> bool {
    let rest = text.strip_prefix("E-").or_else(|| text.strip_prefix("W-"));
    rest.is_some_and(|rest| {
        rest.len() > 1 && rest.chars().all(|c| c.is_ascii_uppercase() || c.is_ascii_digit() || c == '-')
    })
}

/// Whether a text holds a code as a word.
fn holds(text: &str, code: &str) -> bool {
    text.match_indices(code).any(|(at, _)| {
        !text[at + code.len()..].starts_with(|next: char| next == '-' || next.is_ascii_alphanumeric())
    })
}

fn rust_files(folder: &Path, files: &mut Vec<PathBuf>) {
    let mut entries: Vec<PathBuf> =
        std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            rust_files(&path, files);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
}
