//! Inherent implementations of one type in several files: a call of `self.method()` leads to the file that has it.

use std::collections::BTreeMap;
use std::path::Path;

use proc_macro2::Span;
use syn::visit::{self, Visit};

/// An inherent implementation: its type as written, the methods that it has, and those that it calls on `self`.
pub(crate) struct Implementation {
    pub(crate) of: Vec<String>,
    pub(crate) methods: Vec<String>,
    pub(crate) calls: BTreeMap<String, usize>,
}

impl Implementation {
    /// `None` for an implementation of a trait, or of something that is not a path.
    pub(crate) fn new(item: &syn::ItemImpl) -> Option<Self> {
        let syn::Type::Path(of) = &*item.self_ty else {
            return None;
        };
        if item.trait_.is_some() || of.qself.is_some() {
            return None;
        }
        let names = of.path.segments.iter().map(|part| part.ident.to_string());
        let methods = item.items.iter().filter_map(|item| match item {
            syn::ImplItem::Fn(method) => Some(method.sig.ident.to_string()),
            _ => None,
        });
        let mut calls = Calls::default();
        calls.visit_item_impl(item);
        Some(Self {
            of: names.collect(),
            methods: methods.collect(),
            calls: calls.0,
        })
    }
}

/// Calls among implementations of one type in several files: from, to, line, method.
pub(crate) fn calls_between<'a>(
    all: &[(&'a Path, &'a Implementation)],
) -> Vec<(&'a Path, &'a Path, usize, &'a String)> {
    let mut found = Vec::new();
    for (from, caller) in all {
        for (method, line) in &caller.calls {
            let mut places = all.iter().filter(|(_, has)| has.methods.contains(method));
            if let Some((to, _)) = places.next().filter(|(to, _)| to != from) {
                found.push((*from, *to, *line, method));
            }
        }
    }
    found
}

/// Methods called on `self`, with the line of the first call.
#[derive(Default)]
struct Calls(BTreeMap<String, usize>);

impl Calls {
    fn call(&mut self, name: &syn::Ident, at: Span) {
        self.0.entry(name.to_string()).or_insert(at.start().line);
    }
}

impl<'a> Visit<'a> for Calls {
    fn visit_expr_method_call(&mut self, call: &'a syn::ExprMethodCall) {
        if let syn::Expr::Path(receiver) = &*call.receiver
            && receiver.path.is_ident("self")
        {
            self.call(&call.method, call.method.span());
        }
        visit::visit_expr_method_call(self, call);
    }

    fn visit_path(&mut self, path: &'a syn::Path) {
        let parts: Vec<&syn::PathSegment> = path.segments.iter().collect();
        if let [first, second] = parts[..]
            && first.ident == "Self"
        {
            self.call(&second.ident, second.ident.span());
        }
        visit::visit_path(self, path);
    }
}
