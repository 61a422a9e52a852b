//! Which exit code each error code comes with, read from the sources.
//!
//! **Steps** 1. Of each `impl Diagnose for T`: for each variant of `T` the codes that `code` may give, and the classes
//! that `class` may give. 2. A variant that asks what it holds for its code, but says its class itself, gives the codes
//! of the types that it holds that class. 3. The exit codes of a code are those of all classes that go with it.

use std::collections::{BTreeMap, BTreeSet};

use espalier_model::diagnose::Class;
use syn::{Expr, ImplItem, Item, Pat, Stmt};

use crate::sources::{Source, Sources, Variant};

/// Code → exit codes.
pub(crate) fn exit_codes(sources: &Sources) -> BTreeMap<String, BTreeSet<u8>> {
    let mut found: BTreeMap<String, BTreeSet<u8>> = BTreeMap::new();
    let errors = errors(sources);
    let codes_of = |type_name: &str| {
        let of_type = errors.iter().filter(move |error| error.variant.of == type_name);
        of_type.flat_map(|error| error.codes.iter().cloned()).collect::<Vec<_>>()
    };
    for error in &errors {
        let mut codes = error.codes.clone();
        if error.asks_for_code {
            codes.extend(
                error.holds.iter().filter(|name| **name != error.variant.of).flat_map(|name| codes_of(name)),
            );
        }
        for code in codes {
            let exits = error.classes.iter().map(|class| exit_code(class));
            found.entry(code).or_default().extend(exits);
        }
    }
    found
}

/// Code → variants of errors that have it.
pub(crate) fn variants(sources: &Sources) -> BTreeMap<String, Vec<Variant>> {
    let mut found: BTreeMap<String, Vec<Variant>> = BTreeMap::new();
    for error in errors(sources) {
        for code in error.codes {
            found.entry(code).or_default().push(error.variant.clone());
        }
    }
    found
}

/// What the sources say of one variant.
struct Found {
    variant: Variant,
    codes: BTreeSet<String>,
    asks_for_code: bool,
    classes: BTreeSet<String>,
    /// Names of types in its fields.
    holds: Vec<String>,
}

fn errors(sources: &Sources) -> Vec<Found> {
    let parse = |source: &Source| syn::parse_file(&source.text).expect("Rust").items;
    let files: Vec<(&Source, Vec<Item>)> =
        sources.program.iter().map(|source| (source, parse(source))).collect();
    let mut found = Vec::new();
    for (source, items) in &files {
        for item in items {
            let Item::Impl(implementation) = item else { continue };
            let Some(of) = type_name(&implementation.self_ty) else { continue };
            let Some(code) = body(&implementation.items, "code") else { continue };
            let class = body(&implementation.items, "class");
            // The kinds of an error may stand in a file of their own: that of the module.
            let module = source.path.with_file_name("mod.rs");
            let of_module = files.iter().find(|(other, _)| other.path == module).map(|(_, items)| items);
            let declares = |items: &&Vec<Item>| items.iter().any(|item| is_enum(item, &of));
            let declared = [Some(items), of_module].into_iter().flatten().find(declares).unwrap_or(items);
            for (name, holds) in variants_of(declared, &of) {
                let (codes, asks_for_code) = outcomes(code, &name, &literal);
                let classes = class.map(|class| outcomes(class, &name, &class_name).0).unwrap_or_default();
                let variant = Variant { crate_name: source.crate_name.clone(), of: of.clone(), name };
                found.push(Found { variant, codes, asks_for_code, classes, holds });
            }
        }
    }
    found
}

fn exit_code(class: &str) -> u8 {
    let known = Class::ALL.into_iter().find(|known| format!("{known:?}") == class);
    known.expect("a class").exit_code()
}

/// The variants of an enum with the types in their fields; of a struct one with its own name.
fn variants_of(items: &[Item], of: &str) -> Vec<(String, Vec<String>)> {
    let enums = items.iter().find(|item| is_enum(item, of)).and_then(|item| match item {
        Item::Enum(item) => Some(item),
        _ => None,
    });
    let Some(found) = enums else { return vec![(of.to_owned(), Vec::new())] };
    let held = |variant: &syn::Variant| variant.fields.iter().flat_map(|field| names_in(&field.ty)).collect();
    found.variants.iter().map(|variant| (variant.ident.to_string(), held(variant))).collect()
}

fn is_enum(item: &Item, name: &str) -> bool {
    matches!(item, Item::Enum(item) if item.ident == name)
}

fn type_name(of: &syn::Type) -> Option<String> {
    names_in(of).pop()
}

/// The last names of a type's path and of what stands in its angle brackets.
fn names_in(of: &syn::Type) -> Vec<String> {
    let syn::Type::Path(path) = of else { return Vec::new() };
    let Some(last) = path.path.segments.last() else { return Vec::new() };
    let mut names = vec![last.ident.to_string()];
    if let syn::PathArguments::AngleBracketed(arguments) = &last.arguments {
        for argument in &arguments.args {
            if let syn::GenericArgument::Type(inner) = argument {
                names.extend(names_in(inner));
            }
        }
    }
    names
}

/// The expression that a method of this name ends with.
fn body<'a>(items: &'a [ImplItem], name: &str) -> Option<&'a Expr> {
    let method = items.iter().find_map(|item| match item {
        ImplItem::Fn(method) if method.sig.ident == name => Some(method),
        _ => None,
    })?;
    match method.block.stmts.last()? {
        Stmt::Expr(expression, None) => Some(expression),
        _ => None,
    }
}

/// What an expression may come to for a variant, and whether it may ask something else.
fn outcomes(
    expression: &Expr,
    variant: &str,
    plain: &dyn Fn(&Expr) -> Option<String>,
) -> (BTreeSet<String>, bool) {
    if let Some(value) = plain(expression) {
        return (BTreeSet::from([value]), false);
    }
    let mut found = (BTreeSet::new(), false);
    let mut add = |expression: &Expr| {
        let (values, asks) = outcomes(expression, variant, plain);
        found.0.extend(values);
        found.1 |= asks;
    };
    match expression {
        Expr::Match(cases) => {
            for arm in &cases.arms {
                let Some(is_certain) = matches(&arm.pat, variant) else { continue };
                add(&arm.body);
                if is_certain {
                    break;
                }
            }
        }
        Expr::If(choice) => {
            let is_it = is_matched(&choice.cond, variant);
            if let (true, Some(Stmt::Expr(value, None))) =
                (is_it != Some(false), choice.then_branch.stmts.last())
            {
                add(value);
            }
            let otherwise = choice.else_branch.iter().filter(|_| is_it != Some(true));
            otherwise.for_each(|(_, value)| add(value));
        }
        Expr::Block(block) => {
            if let Some(Stmt::Expr(value, None)) = block.block.stmts.last() {
                add(value);
            }
        }
        _ => found.1 = true,
    }
    found
}

/// Of a condition `matches!(self, Self::…)`, whether it holds for a variant.
fn is_matched(condition: &Expr, variant: &str) -> Option<bool> {
    let Expr::Macro(call) = condition else { return None };
    let names = call.mac.tokens.to_string();
    let is_plain = call.mac.path.is_ident("matches") && names.starts_with("self ,");
    is_plain.then(|| names.split(|c: char| !c.is_alphanumeric()).any(|name| name == variant))
}

/// Whether a pattern may be that of a variant, and whether it then always is.
fn matches(pattern: &Pat, variant: &str) -> Option<bool> {
    let is_it = |path: &syn::Path| path.segments.last().is_some_and(|last| last.ident == variant);
    match pattern {
        Pat::Or(cases) => {
            let fits: Vec<bool> = cases.cases.iter().filter_map(|case| matches(case, variant)).collect();
            (!fits.is_empty()).then(|| fits.contains(&true))
        }
        Pat::Struct(case) if case.path.segments.first().is_some_and(|first| first.ident == "Self") => {
            // Fields of a struct type decide by their values; those of a variant are mostly just named.
            let is_struct = case.path.segments.len() == 1;
            (is_struct || is_it(&case.path))
                .then(|| !is_struct && case.fields.iter().all(|field| is_open(&field.pat)))
        }
        Pat::TupleStruct(case) => is_it(&case.path).then(|| case.elems.iter().all(is_open)),
        Pat::Path(case) => is_it(&case.path).then_some(true),
        Pat::Guard(case) => matches(&case.pat, variant).map(|_| false),
        Pat::Wild(_) | Pat::Ident(_) => Some(true),
        _ => None,
    }
}

/// Whether a pattern takes whatever there is.
fn is_open(pattern: &Pat) -> bool {
    matches!(pattern, Pat::Wild(_) | Pat::Ident(_) | Pat::Rest(_))
}

fn literal(expression: &Expr) -> Option<String> {
    match expression {
        Expr::Lit(syn::ExprLit { lit: syn::Lit::Str(text), .. }) => Some(text.value()),
        _ => None,
    }
}

fn class_name(expression: &Expr) -> Option<String> {
    let Expr::Path(path) = expression else { return None };
    let names: Vec<String> = path.path.segments.iter().map(|part| part.ident.to_string()).collect();
    match names.as_slice() {
        [.., class, name] if class == "Class" => Some(name.clone()),
        _ => None,
    }
}
