//! The module tree of every crate, and which files refer to which, with imports resolved as the compiler does.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use proc_macro2::{Span, TokenStream, TokenTree};
use syn::visit::{self, Visit};

use crate::tidy::items::{is_cfg_test, is_for_tests, item_name, path_attribute};
use crate::tidy::methods::{Implementation, calls_between};

/// Longest chain of re-exports to follow.
const LONGEST_CHAIN: usize = 16;

/// A reference from one file to another.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Import {
    /// The referring file.
    pub(crate) from: PathBuf,
    /// The file that defines the item.
    pub(crate) to: PathBuf,
    /// Line in `from`, from 1.
    pub(crate) line: usize,
    /// The path as written.
    pub(crate) path: String,
}

/// A module, inline or in a separate file.
#[derive(Default)]
struct Module {
    file: PathBuf,
    parent: usize,
    children: BTreeMap<String, usize>,
    items: BTreeSet<String>,
    aliases: BTreeMap<String, Vec<String>>,
    globs: Vec<Vec<String>>,
    /// Paths that the module refers to.
    named: Vec<Named>,
    implementations: Vec<Implementation>,
}

/// A path that a module refers to.
struct Named {
    path: Vec<String>,
    line: usize,
    /// Whether a path of one word may be a module; in an expression it is more likely a variable of the same name.
    may_be_module: bool,
}

/// The modules of one crate.
pub(crate) struct Crate {
    modules: Vec<Module>,
}

/// The meaning of a name: a module, or an item defined in a module.
enum Meaning {
    Module(usize),
    Item(usize),
}

impl Crate {
    /// Reads a crate from its first file.
    pub(crate) fn read(first: &Path) -> Self {
        let mut found = Self {
            modules: Vec::new(),
        };
        let folder = first.parent().expect("a folder").to_owned();
        found.add_file(first.to_owned(), folder, 0);
        found
    }

    /// The files of the crate.
    pub(crate) fn files(&self) -> BTreeSet<&Path> {
        let files = self.modules.iter().map(|module| module.file.as_path());
        files.collect()
    }

    /// All references from one file of the crate to another.
    pub(crate) fn imports(&self) -> Vec<Import> {
        let mut imports = Vec::new();
        for (module, content) in self.modules.iter().enumerate() {
            for named in &content.named {
                let target = match self.meaning(module, &named.path, LONGEST_CHAIN) {
                    Some(Meaning::Module(target)) if named.may_be_module => target,
                    Some(Meaning::Item(target)) => target,
                    _ => continue,
                };
                let to = &self.modules[target].file;
                if *to != content.file {
                    imports.push(Import {
                        from: content.file.clone(),
                        to: to.clone(),
                        line: named.line,
                        path: named.path.join("::"),
                    });
                }
            }
        }
        imports.extend(self.calls());
        imports.sort();
        imports.dedup();
        imports
    }

    /// References to other files by methods of the same type that they have.
    fn calls(&self) -> Vec<Import> {
        let mut types = BTreeMap::<(usize, &String), Vec<(&Path, &Implementation)>>::new();
        for (module, content) in self.modules.iter().enumerate() {
            for found in &content.implementations {
                if let (Some(Meaning::Item(owner)), Some(name)) = (
                    self.meaning(module, &found.of, LONGEST_CHAIN),
                    found.of.last(),
                ) {
                    let all = types.entry((owner, name)).or_default();
                    all.push((&content.file, found));
                }
            }
        }
        let calls = types.values().flat_map(|all| calls_between(all));
        let import = |(from, to, line, method): (&Path, &Path, usize, &String)| Import {
            from: from.to_path_buf(),
            to: to.to_path_buf(),
            line,
            path: format!("self.{method}"),
        };
        calls.map(import).collect()
    }

    fn add_file(&mut self, file: PathBuf, folder: PathBuf, parent: usize) -> usize {
        let text =
            fs::read_to_string(&file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        let syntax =
            syn::parse_file(&text).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        let module = self.add_module(file, parent);
        self.fill(module, &folder, &syntax.items);
        module
    }

    fn add_module(&mut self, file: PathBuf, parent: usize) -> usize {
        self.modules.push(Module {
            file,
            parent,
            ..Module::default()
        });
        self.modules.len() - 1
    }

    /// Adds the items of a module; the files of its children are in `folder`.
    fn fill(&mut self, module: usize, folder: &Path, items: &[syn::Item]) {
        for item in items {
            if let syn::Item::Mod(child) = item {
                self.add_child(module, folder, child);
            } else if !is_for_tests(item) {
                let content = &mut self.modules[module];
                if let Some(name) = item_name(item) {
                    content.items.insert(name);
                }
                if let syn::Item::Impl(item) = item {
                    content.implementations.extend(Implementation::new(item));
                }
                Names { module: content }.visit_item(item);
            }
        }
    }

    fn add_child(&mut self, parent: usize, folder: &Path, item: &syn::ItemMod) {
        let name = item.ident.to_string();
        let child = if let Some((_, items)) = &item.content {
            // Test modules within a file import for tests only. Tests in separate files are treated like other files.
            if is_cfg_test(&item.attrs) {
                return;
            }
            let child = self.add_module(self.modules[parent].file.clone(), parent);
            self.fill(child, &folder.join(&name), items);
            child
        } else if let Some(path) = path_attribute(&item.attrs) {
            let file = self.modules[parent].file.with_file_name(path);
            let below = file.parent().expect("a folder").to_owned();
            self.add_file(file, below, parent)
        } else {
            let below = folder.join(&name);
            let flat = below.with_extension("rs");
            let file = if flat.exists() {
                flat
            } else {
                below.join("mod.rs")
            };
            self.add_file(file, below, parent)
        };
        self.modules[parent].children.insert(name, child);
    }

    /// Resolves a path in `module`.
    fn meaning(&self, module: usize, path: &[String], chain: usize) -> Option<Meaning> {
        let (first, mut rest) = path.split_first()?;
        let mut place = match first.as_str() {
            "crate" => 0,
            "self" => module,
            "super" => self.modules[module].parent,
            name => match self.lookup(module, name, rest.is_empty(), chain)? {
                Meaning::Module(place) => place,
                item @ Meaning::Item(_) => return Some(item),
            },
        };
        while let Some((name, after)) = rest.split_first() {
            place = match name.as_str() {
                "super" => self.modules[place].parent,
                name => match self.lookup(place, name, after.is_empty(), chain) {
                    Some(Meaning::Module(place)) => place,
                    Some(item) => return Some(item),
                    // From a macro or an extern crate: the owner is unknown, so the current module is assumed.
                    None => return Some(Meaning::Item(place)),
                },
            };
            rest = after;
        }
        Some(Meaning::Module(place))
    }

    /// Resolves a name in a module; `last` says whether the path ends with it.
    fn lookup(&self, module: usize, name: &str, last: bool, chain: usize) -> Option<Meaning> {
        let chain = chain.checked_sub(1)?;
        let content = &self.modules[module];
        let item = || {
            content
                .items
                .contains(name)
                .then_some(Meaning::Item(module))
        };
        let child = || content.children.get(name).map(|id| Meaning::Module(*id));
        let own = if last {
            item().or_else(child)
        } else {
            child().or_else(item)
        };
        own.or_else(|| self.meaning(module, content.aliases.get(name)?, chain))
            .or_else(|| {
                content
                    .globs
                    .iter()
                    .find_map(|glob| match self.meaning(module, glob, chain)? {
                        Meaning::Module(other) if other != module => {
                            self.lookup(other, name, last, chain)
                        }
                        _ => None,
                    })
            })
    }
}

/// Collects the paths that the items of a module refer to.
struct Names<'a> {
    module: &'a mut Module,
}

impl Names<'_> {
    fn name(&mut self, path: Vec<String>, at: Span, may_be_module: bool) {
        self.module.named.push(Named {
            may_be_module: may_be_module || path.len() > 1,
            path,
            line: at.start().line,
        });
    }

    fn import(&mut self, before: &[String], tree: &syn::UseTree) {
        let with = |name: &syn::Ident| [before, &[name.to_string()]].concat();
        match tree {
            syn::UseTree::Path(path) => self.import(&with(&path.ident), &path.tree),
            syn::UseTree::Name(name) if name.ident == "self" => self.alias(
                before.last().cloned().unwrap_or_default(),
                before.to_vec(),
                name.ident.span(),
            ),
            syn::UseTree::Name(name) => {
                self.alias(name.ident.to_string(), with(&name.ident), name.ident.span());
            }
            syn::UseTree::Rename(rename) => self.alias(
                rename.rename.to_string(),
                with(&rename.ident),
                rename.ident.span(),
            ),
            syn::UseTree::Glob(glob) => {
                self.module.globs.push(before.to_vec());
                self.name(before.to_vec(), glob.star_token.spans[0], true);
            }
            syn::UseTree::Group(group) => {
                for tree in &group.items {
                    self.import(before, tree);
                }
            }
        }
    }

    fn alias(&mut self, name: String, path: Vec<String>, at: Span) {
        // `use name;` of an extern crate would resolve to itself.
        if path.as_slice() != [name.clone()] {
            self.module.aliases.insert(name, path.clone());
        }
        self.name(path, at, true);
    }

    /// Paths in macro tokens, which the parser does not process.
    fn tokens(&mut self, tokens: TokenStream, of_item: bool) {
        let mut path: Vec<String> = Vec::new();
        let mut begin = None;
        let mut colons = 0;
        for token in tokens {
            match token {
                TokenTree::Ident(ident) => {
                    if colons != 2 {
                        self.end_of(&mut path, begin, of_item);
                    }
                    if path.is_empty() {
                        begin = Some(ident.span());
                    }
                    path.push(ident.to_string());
                    colons = 0;
                }
                TokenTree::Punct(mark) if mark.as_char() == ':' => colons += 1,
                other => {
                    self.end_of(&mut path, begin, of_item);
                    colons = 0;
                    if let TokenTree::Group(group) = other {
                        self.tokens(group.stream(), of_item);
                    }
                }
            }
        }
        self.end_of(&mut path, begin, of_item);
    }

    fn end_of(&mut self, path: &mut Vec<String>, begin: Option<Span>, of_item: bool) {
        let path = core::mem::take(path);
        // `super` or `crate` alone is a visibility.
        let of_visibility = matches!(path.as_slice(), [word] if word == "super" || word == "crate");
        if let (Some(span), false, false) = (begin, path.is_empty(), of_visibility) {
            self.name(path, span, of_item);
        }
    }
}

impl<'a> Visit<'a> for Names<'_> {
    fn visit_item_use(&mut self, item: &'a syn::ItemUse) {
        if item.leading_colon.is_none() {
            self.import(&[], &item.tree);
        }
    }

    fn visit_path(&mut self, path: &'a syn::Path) {
        if let (None, Some(first)) = (path.leading_colon, path.segments.first()) {
            let names = path.segments.iter().map(|part| part.ident.to_string());
            self.name(names.collect(), first.ident.span(), false);
        }
        visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, item: &'a syn::Macro) {
        visit::visit_macro(self, item);
        self.tokens(item.tokens.clone(), false);
    }

    fn visit_item_macro(&mut self, item: &'a syn::ItemMacro) {
        visit::visit_item_macro(self, item);
        self.tokens(item.mac.tokens.clone(), true);
    }

    // Paths in `pub(in path)` and attributes are not dependencies.
    fn visit_visibility(&mut self, _: &'a syn::Visibility) {}
    fn visit_attribute(&mut self, _: &'a syn::Attribute) {}
}
